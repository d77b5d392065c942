"""Files of faults: an array of tables in TOML, checked."""

import os
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from qpmpc.errors import InputError
from qpmpc.faults.kinds import KINDS, KindName, SignalName
from qpmpc.input_text import read_text
from qpmpc.settings import load_toml, validated

LARGEST_VALUE = 1e9
LONGEST_S = 1_000_000
MOST_FAULTS = 1000
MEGABYTES_MAX = 1


class Fault(BaseModel):
    """One fault of a run.

    Attributes
    ----------
    kind : see `KINDS`
    signal : that is faulty, for the kinds that are faults of one
    at_s : first second of the fault, 0 at departure
    for_s : number of seconds that it lasts
    value : see `KINDS`
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    kind: KindName
    signal: SignalName | None = None
    at_s: Annotated[int, Field(ge=0, le=LONGEST_S)]
    for_s: Annotated[int, Field(ge=1, le=LONGEST_S)] = 1
    value: Annotated[float, Field(ge=-LARGEST_VALUE, le=LARGEST_VALUE)] | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        kind = KINDS[self.kind]
        if kind.signals and self.signal not in kind.signals:
            raise ValueError(f"signal of kind {self.kind} must be one of {', '.join(kind.signals)}")
        if not kind.signals and self.signal is not None:
            raise ValueError(f"signal must be left out: {self.kind} is no fault of a signal")
        if not kind.value and self.value is not None:
            raise ValueError(f"value must be left out: kind {self.kind} has none")
        if kind.value and self.value is None:
            raise ValueError(f"value is missing: kind {self.kind} needs one ({kind.value})")
        if self.value is None:
            return self
        if kind.whole and not (self.value >= 1.0 and self.value.is_integer()):
            raise ValueError(f"value of kind {self.kind} must be whole seconds, 1 or more")
        if self.signal == "second" and not self.value.is_integer():
            raise ValueError("value of signal second must be whole seconds")
        if self.signal == "engine_on" and self.kind == "jump" and self.value not in (0.0, 1.0):
            raise ValueError("value of signal engine_on must be 0 or 1")
        return self

    @property
    def end_s(self) -> int:
        """First second after the fault."""
        return self.at_s + self.for_s

    def holds(self, second: int) -> bool:
        """Whether it is there in a second."""
        return self.at_s <= second < self.end_s

    @property
    def what(self) -> str:
        """What is wrong, in words."""
        signal = f" of {self.signal}" if self.signal else ""
        return f"{self.kind}{signal}{'' if self.value is None else f' ({self.value:g})'}"


class Faults(tuple[Fault, ...]):
    """Faults of one run, in the order of the file.

    Several may overlap; those of one signal then act one after the other, in this order.
    """

    __slots__ = ()

    def check_within(self, steps: int) -> None:
        """Check that each begins in a trip of that many seconds.

        Raises
        ------
        InputError
            If one does not.
        """
        for number, fault in enumerate(self, start=1):
            if fault.at_s >= steps:
                raise InputError(
                    f"fault {number}: at_s must be below {steps}, the seconds of the trip "
                    f"(given: {fault.at_s})"
                )


FaultsLike = str | os.PathLike[str] | Sequence[Fault | Mapping[str, Any]]


def load_faults(path: str | os.PathLike[str]) -> Faults:
    """Load faults from a TOML file: an array of tables ``[[fault]]`` with the keys of `Fault`.

    Raises
    ------
    InputError
        If the file cannot be read, or a key or value is not allowed; one line that names file,
        fault and key.
    """
    label = os.fspath(path)
    text = read_text(path, MEGABYTES_MAX, "faults file ")
    data = load_toml(text, label)
    found = data.get("fault")
    if list(data) != ["fault"] or not isinstance(found, list):
        raise InputError(f"{label}: must hold tables [[fault]], one for each fault, and no others")
    return _checked(found, label)


def as_faults(what: FaultsLike) -> Faults:
    """Return faults from a file's name, from faults, or from mappings with the keys of `Fault`.

    Raises
    ------
    InputError
        See `load_faults`.
    """
    if isinstance(what, str | os.PathLike):
        return load_faults(what)
    if not isinstance(what, Sequence):
        raise InputError(f"faults must be a file or a list of faults, not {type(what).__name__}")
    return _checked(what, "faults")


def _checked(found: Sequence[object], owner: str) -> Faults:
    if not 1 <= len(found) <= MOST_FAULTS:
        raise InputError(f"{owner}: {len(found)} faults, where 1 to {MOST_FAULTS} are allowed")
    return Faults(
        each if isinstance(each, Fault) else _fault(each, f"{owner}: fault {i}")
        for i, each in enumerate(found, start=1)
    )


def _fault(data: object, owner: str) -> Fault:
    if not isinstance(data, Mapping):
        raise InputError(f"{owner}: must be a table")
    return validated(Fault, dict(data), owner)
