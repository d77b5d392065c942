"""A linked image: variables, their types and addresses, and constants, from ELF and DWARF."""

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from qpmpc.errors import InputError

KINDS = {  # DWARF's encoding and size, and the format of `struct`
    (0x04, 4): "f",
    (0x04, 8): "d",
    (0x05, 4): "i",
    (0x07, 4): "I",
    (0x05, 1): "b",
    (0x07, 1): "B",
}
ALLOCATED, WRITABLE = 0x2, 0x1  # flags of a section: SHF_ALLOC, SHF_WRITE
OP_ADDRESS = 0x03  # DW_OP_addr
_TRANSPARENT = ("DW_TAG_typedef", "DW_TAG_const_type", "DW_TAG_volatile_type")


@dataclass(frozen=True)
class Place:
    """A number in memory: address, and its format of `struct`."""

    address: int
    kind: str


@dataclass(frozen=True)
class Segment:
    """A section of the image."""

    name: str
    address: int
    size: int
    is_writable: bool


class Image:
    """An ELF file with debug information.

    Parameters
    ----------
    file : linked, of any 32-bit or 64-bit target

    Attributes
    ----------
    is_little_endian : order of bytes

    Raises
    ------
    InputError
        If it cannot be read, is no ELF file or has no debug information.
    """

    def __init__(self, file: Path) -> None:
        try:
            from elftools.common.exceptions import ELFError
            from elftools.elf.elffile import ELFFile
        except ImportError as error:
            raise InputError("qpmpc a2l needs pyelftools: pip install 'qpmpc-iptm[a2l]'") from error
        self.file = file
        try:
            with file.open("rb") as stream:
                elf = ELFFile(stream)
                if not elf.has_dwarf_info():
                    raise InputError(f"{file}: no debug information, build with -g")
                self.is_little_endian = bool(elf.little_endian)
                self._sections = [
                    (Segment(s.name, s["sh_addr"], s["sh_size"], bool(s["sh_flags"] & WRITABLE)), s)
                    for s in elf.iter_sections()
                    if s["sh_flags"] & ALLOCATED and s["sh_size"]
                ]
                self._data = {
                    segment.name: b"" if s["sh_type"] == "SHT_NOBITS" else s.data()
                    for segment, s in self._sections
                }
                self._variables = dict(_variables(elf.get_dwarf_info(), self.is_little_endian))
        except OSError as error:
            raise InputError(f"{file}: {error.strerror}") from error
        except ELFError as error:
            raise InputError(f"{file}: no ELF file ({error})") from error

    @property
    def segments(self) -> list[Segment]:
        """Sections that are in memory."""
        return [segment for segment, _ in self._sections]

    def of_type(self, name: str) -> dict[str, str]:
        """Return the variables of a type, also inside of others: paths, with their type's name.

        A generated project may have a prefix before the type's name.
        """
        found = {}
        for variable, (address, of) in self._variables.items():
            if self._is_in_memory(address):
                for path, kind in _search(of, name):
                    found[variable + path] = kind
        return found

    def members(self, path: str) -> list[str]:
        """Return the names of the members of a structure."""
        _, of = self._find(path)
        return [_text(child, "DW_AT_name") for child in _structure(of).iter_children()]

    def address(self, path: str) -> int:
        """Return where a variable or a part of one begins."""
        return self._find(path)[0]

    def place(self, path: str) -> Place:
        """Return where a number is: a variable, members behind dots, elements in brackets.

        Raises
        ------
        InputError
            If there is no such number.
        """
        address, of = self._find(path)
        try:
            encoding, size = of.attributes["DW_AT_encoding"].value, _size(of)
            return Place(address, KINDS[encoding, size])
        except KeyError:
            raise InputError(f"{self.file}: {path} is no number") from None

    def numbers(self, path: str, count: int = 1) -> list[float]:
        """Return constants from flash, of an array so many."""
        place = self.place(f"{path}[0]" if count > 1 else path)
        form = f"{'<' if self.is_little_endian else '>'}{count}{place.kind}"
        for segment, _ in self._sections:
            at = place.address - segment.address
            if 0 <= at < segment.size and self._data[segment.name]:
                return [float(x) for x in struct.unpack_from(form, self._data[segment.name], at)]
        raise InputError(f"{self.file}: {path} is no constant")

    def has(self, path: str) -> bool:
        """Whether there is such a variable or member."""
        try:
            self._find(path)
        except InputError:
            return False
        return True

    def _is_in_memory(self, address: int) -> bool:
        return any(0 <= address - s.address < s.size for s in self.segments)

    def _find(self, path: str) -> tuple[int, Any]:
        name, *steps = path.replace("[", ".[").split(".")
        if name not in self._variables:
            raise InputError(f"{self.file}: no variable {name}")
        address, of = self._variables[name]
        for step in steps:
            if step.startswith("["):
                element = _plain(of.get_DIE_from_attribute("DW_AT_type"))
                address, of = address + int(step[1:-1]) * _size(element), element
                continue
            for child in _structure(of).iter_children():
                if _text(child, "DW_AT_name") == step:
                    address += child.attributes["DW_AT_data_member_location"].value
                    of = _plain(child.get_DIE_from_attribute("DW_AT_type"))
                    break
            else:
                raise InputError(f"{self.file}: {path}: no member {step}")
        return address, of


def _variables(dwarf: Any, is_little_endian: bool) -> Iterator[tuple[str, tuple[int, Any]]]:
    """Variables at fixed addresses: names, addresses and types."""
    for unit in dwarf.iter_CUs():
        for die in unit.iter_DIEs():
            location = die.attributes.get("DW_AT_location")
            if die.tag != "DW_TAG_variable" or location is None:
                continue
            code = location.value
            if not isinstance(code, list) or not code or code[0] != OP_ADDRESS:
                continue
            of = die
            while "DW_AT_name" not in of.attributes and "DW_AT_specification" in of.attributes:
                of = of.get_DIE_from_attribute("DW_AT_specification")
            if "DW_AT_name" in of.attributes and "DW_AT_type" in of.attributes:
                address = int.from_bytes(bytes(code[1:]), "little" if is_little_endian else "big")
                yield (
                    _text(of, "DW_AT_name"),
                    (address, _plain(of.get_DIE_from_attribute("DW_AT_type"))),
                )


def _search(of: Any, name: str, path: str = "") -> Iterator[tuple[str, str]]:
    """Paths within a type to structures of a type of this name, arrays left out."""
    called = _text(of, "DW_AT_name") if of.tag != "DW_TAG_structure_type" else ""
    if called.endswith(name):
        yield path, called
        return
    inner = _structure(of)
    if inner.tag == "DW_TAG_structure_type":
        for child in inner.iter_children():
            member = _plain(child.get_DIE_from_attribute("DW_AT_type"))
            yield from _search(member, name, f"{path}.{_text(child, 'DW_AT_name')}")


def _plain(die: Any) -> Any:
    """Return a type without const and volatile, and without names but that of a structure."""
    while die.tag in _TRANSPARENT and "DW_AT_type" in die.attributes:
        inner = die.get_DIE_from_attribute("DW_AT_type")
        if die.tag == "DW_TAG_typedef" and inner.tag == "DW_TAG_structure_type":
            return die
        die = inner
    return die


def _structure(die: Any) -> Any:
    return die.get_DIE_from_attribute("DW_AT_type") if die.tag == "DW_TAG_typedef" else die


def _size(die: Any) -> int:
    return int(_structure(die).attributes["DW_AT_byte_size"].value)


def _text(die: Any, attribute: str) -> str:
    """Return a name; only what is one in C."""
    found = die.attributes.get(attribute)
    return re.sub(rb"\W", b"_", found.value).decode("ascii") if found is not None else ""
