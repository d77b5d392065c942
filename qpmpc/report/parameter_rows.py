"""The parameters of a vehicle as rows of a table."""

from collections.abc import Iterator

from qpmpc.report.units import unit_of
from qpmpc.vehicle.parameters import Vehicle

ITEMS_MAX = 16
"""Of an array that is shown in full; a measured engine's line has some 200."""

ENDS = 3  # of a longer one, before its last


def parameter_rows(vehicle: Vehicle) -> Iterator[list[tuple[str, str, str]]]:
    """Yield, section by section, dotted name, value and unit of each parameter that is given."""
    for section, values in vehicle.model_dump(exclude={"name", "description"}).items():
        yield [
            (f"{section}.{key}", _text(value), unit_of(key))
            for key, value in values.items()
            if value is not None
        ]


def _text(value: bool | float | tuple[float, ...]) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    items = value if isinstance(value, tuple) else (value,)
    first = items[:ENDS] if len(items) > ITEMS_MAX else items
    text = " ".join(f"{item:.10g}" for item in first)
    return text if first is items else f"{text} ... {items[-1]:.10g} ({len(items)} values)"
