"""The parameters of a vehicle as rows of a table."""

from collections.abc import Iterator

from qpmpc.report.units import unit_of
from qpmpc.vehicle.parameters import Vehicle


def parameter_rows(vehicle: Vehicle) -> Iterator[list[tuple[str, str, str]]]:
    """Yield, section by section, dotted name, value and unit of each parameter that is given."""
    for section, values in vehicle.model_dump(exclude={"name", "description"}).items():
        yield [
            (f"{section}.{key}", _text(value), unit_of(key))
            for key, value in values.items()
            if value is not None
        ]


def _text(value: float | tuple[float, ...]) -> str:
    items = value if isinstance(value, tuple) else (value,)
    return " ".join(f"{item:.10g}" for item in items)
