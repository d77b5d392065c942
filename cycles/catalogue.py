"""The catalogue of shipped cycles: sources, licence status and published statistics."""

import tomllib
from decimal import Decimal
from functools import cache
from importlib.resources import files
from typing import Annotated, NamedTuple, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

SI_PER_UNIT = {"s": 1.0, "km": 1000.0, "mi": 1609.344, "km/h": 1 / 3.6, "mph": 0.44704}


class Figure(NamedTuple):
    """A published figure with its printed digits, such as ``7.1 mph``."""

    value: Decimal
    unit: str

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read ``"7.1 mph"``; the unit is one of ``s, km, mi, km/h, mph``.

        Raises
        ------
        ValueError
            If the text is not a number, a space and a known unit.
        """
        number, _, unit = text.partition(" ")
        if unit not in SI_PER_UNIT:
            raise ValueError(f"unit of {text!r} must be one of {', '.join(SI_PER_UNIT)}")
        return cls(Decimal(number), unit)

    @property
    def si(self) -> float:
        """The value in s, m or m/s."""
        return float(self.value) * SI_PER_UNIT[self.unit]

    @property
    def rounding_si(self) -> float:
        """Half a unit of the last printed digit, in s, m or m/s."""
        exponent = self.value.as_tuple().exponent
        assert isinstance(exponent, int)  # a string would mean NaN or infinity
        return 0.5 * 10.0**exponent * SI_PER_UNIT[self.unit]

    def __str__(self) -> str:
        return f"{self.value} {self.unit}"


PublishedFigure = Annotated[Figure, BeforeValidator(Figure.parse)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Published(_Strict):
    """Statistics of a cycle as its publisher prints them."""

    duration: PublishedFigure
    distance: PublishedFigure
    speed_mean: PublishedFigure
    speed_max: PublishedFigure


class CatalogueEntry(_Strict):
    """One shipped cycle.

    Attributes
    ----------
    name, title
        Name on the command line, and in full.
    data
        CSV file in this package: ``time_s,speed_mps`` at 1 Hz, or breakpoints if `parts` is given.
    parts
        Parts of the breakpoint file, in the order driven; empty for a 1 Hz file.
    source
        The document that defines the cycle.
    licence
        Its legal status, as far as known.
    note
        Anything that a user must know, such as our interpretation.
    published
        Statistics to check the file against; None if none are published.
    """

    name: Annotated[str, Field(pattern=r"^[a-z0-9-]+$")]
    title: str
    data: Annotated[str, Field(pattern=r"^data/[a-z0-9_]+\.csv$")]
    parts: tuple[str, ...] = ()
    source: str
    licence: str
    note: str = ""
    published: Published | None = None


class _Catalogue(_Strict):
    cycle: tuple[CatalogueEntry, ...]

    @model_validator(mode="after")
    def _names_differ(self) -> Self:
        names = [entry.name for entry in self.cycle]
        if len(set(names)) != len(names):
            raise ValueError("names of cycles must differ")
        return self


@cache
def catalogue() -> tuple[CatalogueEntry, ...]:
    """All shipped cycles, in the order of ``catalogue.toml``."""
    text = files("qpmpc.cycles").joinpath("catalogue.toml").read_text(encoding="utf-8")
    return _Catalogue.model_validate(tomllib.loads(text)).cycle


def cycle_names() -> tuple[str, ...]:
    """Names of the shipped cycles, as `load_cycle` takes them."""
    return tuple(entry.name for entry in catalogue())
