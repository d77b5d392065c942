"""From a linked image to the text of its A2L file."""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from qpmpc._version import __version__
from qpmpc.codegen.a2l.image import Image, Place
from qpmpc.codegen.a2l.quantities import (
    OF_INPUT,
    OF_OUTPUT,
    OF_STATE,
    UNITS,
    WRONG_ENTRY,
    Limit,
    Measured,
)
from qpmpc.codegen.calibration import DESCRIBED
from qpmpc.codegen.generate import template_text
from qpmpc.controllers.monitor import Flag
from qpmpc.errors import InputError

DATATYPES = {
    "f": "FLOAT32_IEEE",
    "d": "FLOAT64_IEEE",
    "i": "SLONG",
    "I": "ULONG",
    "b": "SBYTE",
    "B": "UBYTE",
}
LAYOUTS = {f"value_{name.lower()}": kind for kind, name in DATATYPES.items()}
IN_USE = "cal"  # the member of mpc_state that holds the numbers in use


@dataclass(frozen=True)
class Item:
    """A CHARACTERISTIC or MEASUREMENT, its limits as they are shown."""

    name: str
    what: str
    place: Place
    conversion: str
    least: float
    most: float
    symbol: str
    offset: int
    mask: int = 0

    @property
    def datatype(self) -> str:
        """Its type in ASAP2."""
        return DATATYPES[self.place.kind]


class Described(NamedTuple):
    """The text of an A2L file: of which instance, and how many numbers it names."""

    text: str
    instance: str
    characteristics: int
    measurements: int


def described(image: Image, state: str | None = None) -> Described:
    """Return the A2L file of a controller.

    Parameters
    ----------
    image : linked with debug information
    state : path of the `mpc_state` in C; may be left out where there is one

    Raises
    ------
    InputError
        If the image has no controller, or several and `state` does not say which.
    """
    instance = _one(image, "mpc_state", state)
    model = _one(image, "mpc_model", None, "mpc_par")
    names = image.members(f"{instance}.calibration")
    characteristics = list(_characteristics(image, instance, model, names))
    measurements = [
        *_measured(image, instance, model, OF_STATE),
        *_in_use(image, instance, characteristics),
    ]
    for kind, table in (("mpc_in", OF_INPUT), ("mpc_out", OF_OUTPUT)):
        for path in sorted(_in_ram(image, kind)):
            measurements += _measured(image, path, model, table)
            if kind == "mpc_out":
                measurements.append(_wrong_entry(image, path))
    tables = {
        "yes_no": {0: "no", 1: "yes"},
        "rung": {0: "optimised", 1: "shifted plan", 2: "rules"},
    }
    tables[WRONG_ENTRY] = {-1: "none", **dict(enumerate(names))}
    text = template_text(
        "controller.a2l.j2",
        version=__version__,
        image=re.sub(r"[^A-Za-z0-9._-]", "_", image.file.name),
        instance=instance,
        is_little_endian=image.is_little_endian,
        segments=image.segments,
        units=UNITS,
        tables=tables,
        layouts=sorted({item.datatype for item in characteristics}),
        characteristics=characteristics,
        measurements=measurements,
        conversion=_conversion,
        number=number,
    )
    return Described(text, instance, len(characteristics), len(measurements))


def _conversion(name: str) -> str:
    """Return the name of the COMPU_METHOD of a unit or a table."""
    plain = {"1": "none", "%": "percent"}.get(name, name)
    return f"of_{re.sub(r'[^A-Za-z0-9_]', '_per_', plain)}"


def _in_ram(image: Image, kind: str) -> list[str]:
    writable = [s for s in image.segments if s.is_writable]

    def is_in_ram(path: str) -> bool:
        address = image.address(path)
        return any(0 <= address - s.address < s.size for s in writable)

    return [path for path in image.of_type(kind) if is_in_ram(path)]


def _one(image: Image, kind: str, chosen: str | None, usual: str = "") -> str:
    found = list(image.of_type(kind)) if usual else _in_ram(image, kind)
    if chosen is not None:
        if chosen not in found:
            raise InputError(f"{image.file}: no {kind} {chosen}; there is {_listed(found)}")
        return chosen
    if not found:
        raise InputError(
            f"{image.file}: no variable of type {kind}: is it the linked program of a generated "
            "controller, compiled with -g?"
        )
    if len(found) != 1:
        listed = _listed(found)
        raise InputError(f"{image.file}: {len(found)} {kind}, {listed}: choose one with --instance")
    return found[0]


def _listed(names: list[str]) -> str:
    return ", ".join(sorted(names)) or "none"


def _item(image: Image, path: str, name: str, **rest: Any) -> Item:
    symbol = re.split(r"[.\[]", path)[0]
    place = image.place(path)
    return Item(
        name=name, place=place, symbol=symbol, offset=place.address - image.address(symbol), **rest
    )


def _characteristics(image: Image, instance: str, model: str, names: list[str]) -> Iterator[Item]:
    """Every number of the page, with the bounds that the image checks."""
    least = image.numbers(f"{model}.cal_least", len(names))
    most = image.numbers(f"{model}.cal_most", len(names))
    for name, low, high in zip(names, least, most, strict=True):
        unit, what = DESCRIBED[name]
        path, factor = f"{instance}.calibration.{name}", UNITS[unit].factor
        yield _item(
            image,
            path,
            path,
            what=what,
            conversion=unit,
            least=shown(low * factor),
            most=shown(high * factor),
        )


def _in_use(image: Image, instance: str, characteristics: list[Item]) -> Iterator[Item]:
    for item in characteristics:
        path = item.name.replace(f"{instance}.calibration.", f"{instance}.{IN_USE}.")
        yield _item(
            image,
            path,
            path,
            what=f"in use: {item.what}",
            conversion=item.conversion,
            least=item.least,
            most=item.most,
        )


def _measured(image: Image, at: str, model: str, table: list[Measured]) -> Iterator[Item]:
    def limit(value: Limit) -> float:
        return image.numbers(f"{model}.{value}")[0] if isinstance(value, str) else float(value)

    for each in table:
        path = f"{at}.{each.path}"
        if not image.has(path):
            continue  # of another method, or of a controller that learns
        factor = UNITS[each.unit].factor
        conversion = each.unit
        if each.table is not None:
            conversion = "yes_no" if len(each.table) == 2 else "rung"
        name = path if not each.mask else f"{path}.{Flag(each.mask).name}".lower()
        yield _item(
            image,
            path,
            name,
            what=each.what,
            conversion=conversion,
            least=shown(limit(each.least) * factor),
            most=shown(limit(each.most) * factor),
            mask=each.mask,
        )


def _wrong_entry(image: Image, at: str) -> Item:
    path = f"{at}.{WRONG_ENTRY}"
    return _item(
        image,
        path,
        path,
        what="number of a calibration that is refused",
        conversion=WRONG_ENTRY,
        least=-1.0,
        most=float(len(DESCRIBED)),
    )


def shown(limit: float) -> float:
    """Return a limit to the seven digits of single precision: 4 %, not 3.99999991 %."""
    return float(f"{limit:.7g}")


def number(value: float) -> str:
    """Return a number as ASAP2 has it, as short as it can be read back to the same."""
    assert math.isfinite(value)
    return repr(value)


def address_of(a2l: Path, name: str) -> tuple[int, str]:
    """Return address and layout of a CHARACTERISTIC of such a file, by the end of its name.

    Raises
    ------
    InputError
        If the file has none.
    """
    pattern = r"/begin CHARACTERISTIC (\S+)\n.*?\n\s*VALUE (0x[0-9A-F]+) (\w+) "
    found = {
        m[1]: (int(m[2], 16), m[3]) for m in re.finditer(pattern, a2l.read_text("ascii"), re.S)
    }
    for full, place in found.items():
        if full == name or full.endswith(f".{name}"):
            return place
    raise InputError(f"{a2l}: no CHARACTERISTIC {name}")
