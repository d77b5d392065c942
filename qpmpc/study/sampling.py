"""Random values of a study: independent, or a Latin hypercube."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    ValidatorFunctionWrapHandler,
    WrapValidator,
    model_validator,
)

from qpmpc.errors import InputError


def _one_value(value: Any, parse: ValidatorFunctionWrapHandler) -> Any:
    try:
        return parse(value)
    except ValidationError:  # of each of the four
        raise ValueError("must be a finite number, a text, true or false") from None


Value = Annotated[bool | int | float | str, WrapValidator(_one_value)]
Values = Annotated[list[Value], Field(min_length=1)]

KINDS = ("uniform", "choice", "each")
SAMPLES_MAX = 1_000_000


class Distribution(BaseModel):
    """How a key is drawn: exactly one of the three.

    Attributes
    ----------
    uniform : both ends of an interval
    choice : one of these, with equal probability
    each : the i-th of these in sample i, from the first again after the last
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    uniform: Annotated[list[float], Field(min_length=2, max_length=2)] | None = None
    choice: Values | None = None
    each: Values | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        if len(self.model_fields_set) != 1:
            raise ValueError(f"must be one of {', '.join(KINDS)}")
        if self.uniform is not None and not self.uniform[0] <= self.uniform[1]:
            raise ValueError("uniform must be [least, most]")
        return self

    @property
    def ends(self) -> list[Value]:
        """All values, or both ends of the interval."""
        return [*map(float, self.uniform or []), *(self.choice or self.each or [])]

    def at(self, share: float, number: int) -> Value:
        """Return the value at a share, 0 to 1, of the probability, or of a sample's number."""
        if self.uniform is not None:
            low, high = self.uniform
            return low + (high - low) * share
        if self.choice is not None:
            return self.choice[min(int(share * len(self.choice)), len(self.choice) - 1)]
        values = self.each or []
        return values[number % len(values)]


class Sample(BaseModel):
    """Random values of several keys.

    Attributes
    ----------
    count : number of samples
    method : `random`, each sample independent of their number, or `latin-hypercube`, which covers
        each key's range evenly
    values : distribution of each key
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    count: Annotated[int, Field(ge=1, le=SAMPLES_MAX)]
    method: Literal["random", "latin-hypercube"] = "random"
    values: Annotated[dict[str, Distribution], Field(min_length=1)]


def points_of(sample: Sample, seed: int) -> Iterator[dict[str, Any]]:
    """Draw all samples, one at a time.

    Raises
    ------
    InputError
        If a Latin hypercube is wanted of keys that are all `each`.
    """
    drawn = [key for key, how in sample.values.items() if how.each is None]
    shares = _shares(sample, len(drawn), seed)
    for number in range(sample.count):
        at = dict(zip(drawn, shares(number), strict=True))
        yield {key: how.at(at.get(key, 0.0), number) for key, how in sample.values.items()}


def _shares(sample: Sample, keys: int, seed: int) -> Any:
    if sample.method == "random":
        return lambda number: np.random.default_rng([seed, number]).random(keys).tolist()
    if not keys:
        raise InputError("a Latin hypercube needs a key that is uniform or choice")
    from scipy.stats.qmc import LatinHypercube

    table: NDArray[np.float64] = LatinHypercube(keys, rng=seed).random(sample.count)
    return lambda number: table[number].tolist()
