"""An FMU as a file: sources, library of this machine, descriptions; same input, same sources."""

import hashlib
import os
import platform
import sys
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from qpmpc.codegen.c_compiler import library_of, required_compiler
from qpmpc.codegen.fmu.description import About, Fmi, build_description, model_description
from qpmpc.codegen.fmu.documentation import documentation
from qpmpc.codegen.fmu.parts import Part
from qpmpc.codegen.generate import template_text, texts_of
from qpmpc.codegen.prefix import FORM, with_prefix
from qpmpc.errors import InputError
from qpmpc.files import check_file, write_bytes

COMMON = ("mpc_fmi.h", "mpc_fmu.h", "mpc_fmu.c")
OF_FMI: dict[Fmi, tuple[str, ...]] = {
    "2": ("mpc_fmi2.c", "mpc_fmi2_unsupported.c", "mpc_fmi2.h"),
    "3": ("mpc_fmi3.c", "mpc_fmi3_unsupported.c", "mpc_fmi3.h"),
}
SUFFIX = ".fmu"
THE_SAME_DAY = (1980, 1, 1, 0, 0, 0)  # of every file in the archive
TOKEN_HEX = (8, 4, 4, 4, 12)  # digits of a GUID's groups


def checked_name(file: Path) -> str:
    """Return the model identifier that a file's name gives, after checking that it can be written.

    Raises
    ------
    InputError
        If the name cannot begin a name in C, or the file cannot be written.
    """
    if file.suffix != SUFFIX or not FORM.fullmatch(file.stem):
        raise InputError(
            f"FILE {file}: the name must be a letter, then at most 30 letters, digits or "
            f"underscores, then {SUFFIX}: it becomes the model identifier"
        )
    check_file(file, "FILE")
    return file.stem


def export_fmu(part: Part, file: str | os.PathLike[str], fmi: Fmi = "2") -> str:
    """Write an FMU for co-simulation, with its sources and a library for this machine.

    Parameters
    ----------
    part : what it holds
    file : its name without `.fmu` becomes the model identifier
    fmi : version of the standard, 2.0 or 3.0

    Returns
    -------
    the platform of the library, as the standard calls it

    Raises
    ------
    InputError
        If the file's name cannot be used or it cannot be written.
    CodegenError
        If there is no C compiler, or it fails.
    """
    path = Path(file)
    identifier = checked_name(path)
    sources = _sources(part, fmi)
    about = About(identifier, identifier, part.description, _token(part, sources, fmi), part.trip_s)
    sources |= _variables(part, about)
    sources = with_prefix(dict(sorted(sources.items())), f"{identifier}_")
    names = [name for name in sources if name.endswith(".c")]
    folder, suffix = _platform(fmi)
    content: dict[str, bytes] = {
        "modelDescription.xml": model_description(fmi, about, part.variables, names),
        **{f"sources/{name}": text.encode() for name, text in sources.items()},
        f"binaries/{folder}/{identifier}{suffix}": _library(sources),
        "documentation/index.html": documentation(about, part.variables).encode(),
        "documentation/licenses/license.txt": part.notice.encode(),
    }
    if fmi == "3":
        content["sources/buildDescription.xml"] = build_description(identifier, names)
    write_bytes(path, _archive(content))
    return folder


def _sources(part: Part, fmi: Fmi) -> dict[str, str]:
    texts = texts_of("fmu/programs")
    return part.sources | {name: texts[name] for name in (*COMMON, *OF_FMI[fmi])}


def _token(part: Part, sources: Mapping[str, str], fmi: Fmi) -> str:
    """Return a GUID made of all that the FMU is made of."""
    digest = hashlib.sha256(f"{fmi} {part.description} {part.variables}".encode())
    for name, text in sorted(sources.items()):
        digest.update(f"{name}\0{text}\0".encode())
    digits, groups = digest.hexdigest(), []
    for count in TOKEN_HEX:
        groups.append(digits[:count])
        digits = digits[count:]
    return f"{{{'-'.join(groups)}}}"


def _variables(part: Part, about: About) -> dict[str, str]:
    context = {
        "token": about.token,
        "trip_s": part.trip_s or 0,
        "prepared": part.prepared,
        "variables": part.variables,
    }
    names = ("mpc_fmu_variables.h", "mpc_fmu_variables.c")
    return {name: template_text(f"{name}.j2", **context) for name in names}


def _library(sources: Mapping[str, str]) -> bytes:
    command = required_compiler("an FMU needs a C compiler: none found")
    return library_of(command, sources, hidden=True)


def _platform(fmi: Fmi) -> tuple[str, str]:
    """Return the folder and the suffix of a library for this machine.

    FMI 2.0 has no name for the processor; FMPy looks into the same folder on each.
    """
    machine = platform.machine().lower().replace("arm64", "aarch64").replace("amd64", "x86_64")
    system, suffix = ("darwin", ".dylib") if sys.platform == "darwin" else ("linux", ".so")
    return (f"{system}64" if fmi == "2" else f"{machine}-{system}"), suffix


def _archive(content: Mapping[str, bytes]) -> bytes:
    stream = BytesIO()
    with ZipFile(stream, "w", ZIP_DEFLATED) as archive:
        for name, data in content.items():
            archive.writestr(ZipInfo(name, THE_SAME_DAY), data, ZIP_DEFLATED)
    return stream.getvalue()
