"""``qpmpc doctor``: what is installed, what is missing, and what that disables."""

from typing import TYPE_CHECKING

import typer

from qpmpc.cli.options import JsonOption

if TYPE_CHECKING:
    from qpmpc.cli.health import Piece

NOT_WELL = 1


def doctor(json_file: JsonOption = None) -> None:
    """Report versions, compilers, tools and folders, and what each missing piece disables.

    Packages are imported and tools are run, each with a time limit. The exit code is 1 if a package
    of the core is missing or broken, else 0: everything else is optional.

    For example:

      qpmpc doctor

      qpmpc doctor --json -
    """
    import platform

    from qpmpc._version import __version__
    from qpmpc.cli.console import result_console, write_json
    from qpmpc.cli.health import folders_found, packages_found, tools_found
    from qpmpc.cli.inputs import check_outputs

    check_outputs(json_file, None)
    pieces = [*packages_found(), *tools_found(), *folders_found()]
    sound = all(piece.state == "ok" for piece in pieces if piece.needed)
    system = f"{platform.system()} {platform.machine()}"
    write_json(
        {
            "qpmpc-iptm": __version__,
            "Python": platform.python_version(),
            "system": system,
            "sound": sound,
            "pieces": [piece.as_json() for piece in pieces],
        },
        json_file,
    )
    console = result_console(json_file)
    console.print(f"qpmpc-iptm {__version__}, Python {platform.python_version()}, {system}")
    for group in dict.fromkeys(piece.group for piece in pieces):
        well = [piece for piece in pieces if piece.group == group and piece.state == "ok"]
        console.print(f"{group}: {', '.join(f'{p.name} {p.found}' for p in well) or 'nothing'}")
    for piece in pieces:
        if piece.state != "ok":
            console.print(_line(piece))
    if not sound:
        raise typer.Exit(NOT_WELL)


def _line(piece: "Piece") -> str:
    owner = piece.name if piece.group in ("tools", "folders") else f"{piece.name} ({piece.group})"
    wrong = f": {piece.found}" if piece.found else ""
    return f"{piece.state}: {owner}{wrong}. Disables: {piece.disables}. Remedy: {piece.remedy}"
