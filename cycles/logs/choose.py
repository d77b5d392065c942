"""Which column or channel has a quantity, and in which unit."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from qpmpc.cycles.logs.quantities import SPEED, LogOptions, Quantity
from qpmpc.delimited import Column
from qpmpc.errors import InputError
from qpmpc.problems import names_shown, shown_value


def columns_of(
    path: Path, columns: Sequence[Column], quantity: Quantity, options: LogOptions
) -> list[Column]:
    """Return the columns of a quantity, best first.

    Raises
    ------
    InputError
        If the column that the options name is not there, or speed or grade is there twice.
    """
    if quantity is SPEED and options.speed_column is not None:
        found = [column for column in columns if column.title == options.speed_column]
        if not found:
            raise InputError(
                f"{path}: --speed-column {shown_value(options.speed_column)}: no such column; "
                f"there are {names_shown([column.title for column in columns])}"
            )
        return found
    found = list(_named(columns, quantity))
    if len(found) > 1 and quantity.name in ("speed", "grade"):
        way_out = "qpmpc convert --speed-column takes one" if quantity is SPEED else "leave one"
        raise InputError(
            f"{path}: {quantity.name} is in two columns, {shown_value(found[0].title)} and "
            f"{shown_value(found[1].title)}: {way_out}"
        )
    return found


def scale_of(
    path: Path, column: Column, quantity: Quantity, options: LogOptions
) -> tuple[float, str]:
    """Return the SI value of a column's unit, and how to speak of that unit.

    Raises
    ------
    InputError
        If neither the file nor the options name one, it is not known, or they contradict.
    """
    name, unit = _split(column, quantity)
    stated = options.units.get(quantity.name, "")
    known = ", ".join(quantity.units)
    if unit and unit not in quantity.units:
        raise InputError(
            f"{path}: {shown_value(column.title)}: unit {shown_value(unit)}, allowed: {known}"
        )
    named = quantity.units[unit] if unit else quantity.implied.get(name)
    if stated and named is not None and named != quantity.units[stated]:
        says = unit or "that by its name"
        raise InputError(
            f"{path}: {shown_value(column.title)} is in {says}, {quantity.option} says {stated}: "
            "one of them is wrong"
        )
    if named is not None:
        return named, f", in {unit}" if unit else ""
    if stated:
        return quantity.units[stated], f", in {stated} as stated"
    example = f"{column.title} [{next(iter(quantity.units))}]"
    raise InputError(
        f"{path}: {shown_value(column.title)} names no unit: add one of {known}, as in "
        f"{shown_value(example)}, or state it with qpmpc convert {quantity.option}"
    )


def names_unit(column: Column, quantity: Quantity, options: LogOptions) -> bool:
    """Whether the unit of a column is known."""
    name, unit = _split(column, quantity)
    return bool(unit or quantity.name in options.units or name in quantity.implied)


def _named(columns: Sequence[Column], quantity: Quantity) -> Iterator[Column]:
    """Columns of the quantity's names, in the names' order."""
    for name in quantity.names:
        for column in columns:
            if column.name == name or _split(column, quantity)[0] == name:
                yield column


def _split(column: Column, quantity: Quantity) -> tuple[str, str]:
    """Name and unit, which may be the last part of the name, or all of it."""
    for unit in sorted(quantity.units, key=len, reverse=True):
        if column.name == unit and quantity.name != "elevation":  # "m" may be a mass
            return quantity.names[0], column.unit or unit
        if column.name.endswith(f"_{unit}"):
            return column.name.removesuffix(f"_{unit}"), column.unit or unit
    return column.name, column.unit
