"""An S-function as a folder: C sources, the script that builds them with mex, README, licence."""

from html import escape
from pathlib import Path

from qpmpc._version import __version__
from qpmpc.codegen.generate import template_text, texts_of
from qpmpc.codegen.parts.part import Part
from qpmpc.codegen.parts.variables import Kind, Role, Variable
from qpmpc.codegen.prefix import FORM, with_prefix
from qpmpc.errors import InputError
from qpmpc.files import check_folder, write_texts

BODY = "s_function.c"


def checked_name(folder: Path) -> str:
    """Return the S-function's name that a folder gives, after checking that it can be written.

    Raises
    ------
    InputError
        If its name cannot begin a name in C, or nothing can be written into it.
    """
    name = folder.name
    if not FORM.fullmatch(name):
        raise InputError(
            f"DIR {folder}: the name must be a letter, then at most 30 letters, digits or "
            "underscores: it becomes that of the S-function"
        )
    check_folder(folder, "DIR")
    return name


def export_s_function(part: Part, folder: Path) -> list[Path]:
    """Write an S-function of Simulink as C sources and the script that builds them.

    Parameters
    ----------
    part : what the block holds
    folder : its last part becomes the S-function's name; files of the same names are replaced,
        others left alone

    Returns
    -------
    the files written

    Raises
    ------
    InputError
        If the folder's name cannot be used or nothing can be written into it.
    """
    return write_texts(folder, s_function_files(part, checked_name(folder)))


def s_function_files(part: Part, name: str) -> dict[str, str]:
    """Return the text of every file, by name; same input, same bytes."""
    body = texts_of("simulink/programs")[BODY]
    sources = with_prefix(part.sources | {BODY: body}, f"{name}_")
    own = f"{name}.c"
    sources[own] = _head(part, name) + sources.pop(BODY)
    modules = sorted(file for file in sources if file.endswith(".c") and file != own)
    others = {
        "build.m": template_text("build.m.j2", name=name, sources=[own, *modules]),
        "README.md": _readme(part, name, [module.removesuffix(".c") for module in modules]),
        "LICENSE.txt": part.notice,
    }
    return dict(sorted((sources | others).items()))


def has_feedthrough(part: Part) -> bool:
    """Whether outputs follow from the inputs of the same second."""
    return any(variable.follows for variable in part.variables)


def types_of(part: Part) -> dict[Kind, str]:
    """Return Simulink's data types, by kind of variable."""
    real = "single" if part.precision == "f32" else "double"
    return {"real": real, "integer": "int32", "boolean": "boolean"}


def _of(part: Part, role: Role) -> list[Variable]:
    return [variable for variable in part.variables if variable.role == role]


def _head(part: Part, name: str) -> str:
    """Return what comes before the functions: what the block is, and its ports."""
    ports = [
        *_lines("input", _of(part, "input"), types_of(part)),
        *_lines("output", _of(part, "output"), types_of(part)),
    ]
    parameters = _of(part, "parameter")
    limits = [
        f"{p.name} of {p.low:.6g} to {p.high:.6g}{'' if p.unit == '1' else f' {p.unit}'}"
        for p in parameters
    ]
    message = f"parameters are {', '.join(limits)}: one real number each, of class double"
    return template_text(
        "s_function_head.c.j2",
        name=name,
        what=part.what,
        ports=ports,
        parameters=[
            f"{place}: {limit}. {parameter.description}"
            for place, (limit, parameter) in enumerate(zip(limits, parameters, strict=True), 1)
        ],
        precision=part.precision,
        feedthrough=has_feedthrough(part),
        message=message if parameters else "this block has no parameters: leave the field empty",
    )


def _lines(role: str, variables: list[Variable], types: dict[Kind, str]) -> list[str]:
    """Return what the comment says of ports."""
    return [
        f"{role} {place}: {', '.join(filter(None, (of.name, types[of.kind], of.unit)))}."
        f" {of.description}"
        for place, of in enumerate(variables, 1)
    ]


def _readme(part: Part, name: str, modules: list[str]) -> str:
    return template_text(
        "SIMULINK.md.j2",
        name=name,
        description=escape(part.description),
        version=__version__,
        inputs=_of(part, "input"),
        outputs=_of(part, "output"),
        parameters=_of(part, "parameter"),
        types=types_of(part),
        modules=modules,
        trip_s=part.trip_s,
        feedthrough=has_feedthrough(part),
    )
