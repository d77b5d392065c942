"""``qpmpc codegen``: the whole controller as a C project."""

from pathlib import Path
from typing import Annotated

import typer

from qpmpc.cli.completion import complete_generated
from qpmpc.cli.options import SetOption, VehicleOption


def codegen(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder of the project.", show_default=False)
    ],
    controller: Annotated[
        str,
        typer.Option(
            metavar="NAME", help="mh-qp or mh-costate.", autocompletion=complete_generated
        ),
    ] = "mh-qp",
    target: Annotated[
        str,
        typer.Option(metavar="TARGET", help="host (shared library) or cortex-m7 (firmware)."),
    ] = "host",
    precision: Annotated[str, typer.Option(metavar="f32|f64", help="For all arithmetic.")] = "f32",
    algorithm: Annotated[
        str | None,
        typer.Option(
            metavar="admm|osqp",
            help="Of mh-qp: written for this problem, or OSQP's own generated code: one instance "
            "only, more memory and time; default: admm.",
            show_default=False,
        ),
    ] = None,
    iterations: Annotated[
        int | None,
        typer.Option(
            metavar="K",
            help="Iterations, or rounds, per step; default: the controller's.",
            show_default=False,
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
    """Write a controller as a C99 project: source, tables, README, licence, Makefile.

    For example:

      qpmpc codegen controller_c

      qpmpc codegen firmware --target cortex-m7 --precision f32 --iterations 25

      qpmpc codegen with_osqp --algorithm osqp --precision f64

      qpmpc codegen costate_c --controller mh-costate

      qpmpc codegen prius_c --vehicle prius-liion --prefix liion_
    """
    from qpmpc.cli.console import result_console
    from qpmpc.cli.inputs import load_vehicle_and_settings
    from qpmpc.codegen.generate import ALGORITHMS, PRECISIONS, TARGETS, generate, one_of
    from qpmpc.codegen.method import GENERATED, ITERATIONS, Method
    from qpmpc.codegen.prefix import checked_prefix
    from qpmpc.errors import InputError
    from qpmpc.registry import without_effect
    from qpmpc.settings import parse_settings

    of_target = one_of(target, TARGETS, "target")
    of_precision = one_of(precision, PRECISIONS, "precision")
    name = one_of(controller, GENERATED, "generated controller")
    if name != "mh-qp" and algorithm is not None:
        raise InputError(f"--algorithm {algorithm} has no effect on {name}: leave it out")
    of_algorithm = one_of(algorithm or "admm", ALGORITHMS, "algorithm")
    checked_prefix(prefix)
    overrides = list(set_ or [])
    if iterations is not None and any(o.startswith(f"{ITERATIONS[name]}=") for o in overrides):
        line = f"--iterations and --set {ITERATIONS[name]} name one setting: leave one out"
        raise InputError(line)
    if iterations is not None:
        overrides.append(f"{ITERATIONS[name]}={iterations}")
    car, settings = load_vehicle_and_settings(vehicle, overrides)
    values = Method.of(name, settings).values(car, None)
    files = generate(values, folder, of_target, of_precision, of_algorithm, prefix)
    sizes = values.sizes
    console = result_console()
    console.print(
        f"{folder}: {len(files)} files written, target {target}, {precision}, "
        f"{of_algorithm if name == 'mh-qp' else name}, {sizes.stages} stages, "
        f"{values.iterations} iterations per step; start with README.md",
    )
    if remark := without_effect(parse_settings(overrides), [name]):
        console.print(remark)
