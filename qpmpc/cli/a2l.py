"""``qpmpc a2l``: the description of a linked controller for calibration tools."""

from pathlib import Path
from typing import Annotated

import typer


def a2l(
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE.a2l", help="To be written.", show_default=False),
    ],
    elf: Annotated[
        Path,
        typer.Option(
            metavar="ELF",
            help="The linked program with the controller, built with -g; [b]make[/b] in a project "
            "of [b]qpmpc codegen DIR --target cortex-m7[/b] makes firmware.elf.",
            show_default=False,
        ),
    ],
    instance: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Of several controllers the variable in C, such as app.left.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Write an ASAP2 file: addresses, bounds and units of the numbers tuned on the car.

    Everything is read from the linked program itself: any board's, whatever it was generated for.
    docs/calibration.md has the numbers, and what is refused.

    For example:

      qpmpc a2l my_controller.a2l --elf my_controller/firmware.elf

      qpmpc a2l left.a2l --elf app.elf --instance app.left
    """
    from qpmpc.cli.console import result_console
    from qpmpc.codegen.a2l.description import described
    from qpmpc.codegen.a2l.image import Image
    from qpmpc.errors import InputError
    from qpmpc.files import write_text

    if file.suffix.lower() != ".a2l":
        raise InputError(f"{file}: the name of an ASAP2 file ends with .a2l")
    found = described(Image(elf), instance)
    write_text(file, found.text)
    result_console().print(
        f"{file}: ASAP2 1.7.1, {found.instance} of {elf}, {found.characteristics} numbers to set, "
        f"{found.measurements} to read"
    )
