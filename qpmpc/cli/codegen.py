"""``qpmpc codegen``: the whole controller as a C project."""

from pathlib import Path
from typing import Annotated

import typer

from qpmpc.cli.options import SetOption, VehicleOption

ITERATIONS = "mh_qp.admm.iterations"


def codegen(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder of the project.", show_default=False)
    ],
    target: Annotated[
        str,
        typer.Option(metavar="TARGET", help="host (shared library) or cortex-m7 (firmware)."),
    ] = "host",
    precision: Annotated[str, typer.Option(metavar="f32|f64", help="For all arithmetic.")] = "f32",
    algorithm: Annotated[
        str,
        typer.Option(
            metavar="admm|osqp",
            help="Written for this problem, or OSQP's own generated code: one instance only, more "
            "memory and time.",
        ),
    ] = "admm",
    iterations: Annotated[
        int | None,
        typer.Option(
            metavar="K", help="Iterations per step; default: the controller's.", show_default=False
        ),
    ] = None,
    prefix: Annotated[
        str,
        typer.Option(
            metavar="NAME_",
            help="Put before every name in the C code, so that several controllers link into one "
            "program.",
            show_default=False,
        ),
    ] = "",
    vehicle: VehicleOption = "prius-nimh",
    set_: SetOption = None,
) -> None:
    """Write the mh-qp controller as a C99 project: source, tables, README, licence, Makefile.

    For example:

      qpmpc codegen controller_c

      qpmpc codegen firmware --target cortex-m7 --precision f32 --iterations 25

      qpmpc codegen with_osqp --algorithm osqp --precision f64

      qpmpc codegen prius_c --vehicle prius-liion --prefix liion_
    """
    from qpmpc.cli.console import result_console
    from qpmpc.cli.inputs import load_vehicle_and_settings
    from qpmpc.codegen.generate import ALGORITHMS, PRECISIONS, TARGETS, generate, one_of
    from qpmpc.codegen.prefix import checked_prefix
    from qpmpc.codegen.values import values_of
    from qpmpc.errors import InputError

    of_target = one_of(target, TARGETS, "target")
    of_precision = one_of(precision, PRECISIONS, "precision")
    of_algorithm = one_of(algorithm, ALGORITHMS, "algorithm")
    checked_prefix(prefix)
    overrides = list(set_ or [])
    if iterations is not None and any(o.startswith(f"{ITERATIONS}=") for o in overrides):
        raise InputError(f"--iterations and --set {ITERATIONS} name one setting: leave one out")
    if iterations is not None:
        overrides.append(f"{ITERATIONS}={iterations}")
    car, settings = load_vehicle_and_settings(vehicle, overrides)
    values = values_of(car, settings.mh_qp, settings.rule_based)
    files = generate(values, folder, of_target, of_precision, of_algorithm, prefix)
    sizes = values.sizes
    result_console().print(
        f"{folder}: {len(files)} files written, target {target}, {precision}, {algorithm}, "
        f"{sizes.stages} stages, {values.iterations} iterations per step; start with README.md",
    )
