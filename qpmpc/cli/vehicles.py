"""``qpmpc vehicles``: parameters with their units, and the piecewise-affine models made of them."""

from typing import TYPE_CHECKING, Annotated

import typer

from qpmpc.cli.completion import complete_vehicle
from qpmpc.cli.options import OutOption

if TYPE_CHECKING:
    from qpmpc.report.pwa_curves import PwaCurve
    from qpmpc.report.table import ShownTable
    from qpmpc.vehicle import Vehicle

SAID = 1e-3  # share of fuel that a curve is above its convex envelope, from which it is said


def vehicles(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME|FILE.toml",
            autocompletion=complete_vehicle,
            help="Show the parameters of this one.",
            show_default=False,
        ),
    ] = None,
    toml: Annotated[
        bool,
        typer.Option("--toml", help="Print only its TOML file, with any base merged in."),
    ] = False,
    out: OutOption = None,
) -> None:
    """List the shipped vehicles, or show the parameters of one and its piecewise-affine models.

    With --out: a picture of the piecewise-affine fits and their errors.
    With --toml: a file to start your own vehicle from.

    For example:

      qpmpc vehicles

      qpmpc vehicles prius-nimh --out results

      qpmpc vehicles prius-liion --toml
    """
    from qpmpc.cli.console import result_console
    from qpmpc.cli.inputs import check_outputs
    from qpmpc.errors import InputError
    from qpmpc.pwa.fit import non_convexity
    from qpmpc.report.pwa_curves import pwa_curves
    from qpmpc.report.write import write_pwa
    from qpmpc.vehicle import load_vehicle, vehicle_file_text
    from qpmpc.vehicle.names import VEHICLES

    if toml:
        if name is None or out is not None:
            raise InputError(
                "--toml prints the file of one vehicle and draws nothing: name it and leave out "
                "--out, e.g. qpmpc vehicles prius-nimh --toml"
            )
        # as bytes, since TOML is UTF-8 whatever the terminal uses
        typer.echo(vehicle_file_text(name).encode(), nl=False)
        return
    if name is None and out is not None:
        raise InputError(
            "--out draws one vehicle: name it, e.g. qpmpc vehicles prius-nimh --out results"
        )
    check_outputs(None, out)
    console = result_console()
    if name is None:
        for known in VEHICLES.names():
            console.print(f"{known}: {load_vehicle(known).description}")
        return
    vehicle = load_vehicle(name)
    curves = pwa_curves(vehicle)
    console.print(f"{vehicle.name}: {vehicle.description}")
    console.print(_parameters(vehicle))
    console.print("Piecewise-affine models of the controllers, with proven error bounds")
    console.print(_pwa(curves))
    lost, at_w = non_convexity(curves[0].x, curves[0].y)
    if lost > SAID:
        console.print(
            f"The fuel curve is not convex: up to {lost:.2%} above its convex envelope, which the "
            f"model approximates, at {at_w / 1e3:.3g} kW"
        )
    if out is not None:
        for remark in write_pwa(vehicle, curves, out):
            console.print(remark)


def _parameters(vehicle: "Vehicle") -> "ShownTable":
    from rich import box

    from qpmpc.report.parameter_rows import parameter_rows
    from qpmpc.report.table import ShownTable

    table = ShownTable(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    table.add_column("parameter", no_wrap=True)
    table.add_column("value", overflow="fold")
    table.add_column("unit", no_wrap=True)
    for section in parameter_rows(vehicle):
        for row in section:
            table.add_row(*row)
        table.add_section()
    return table


def _pwa(curves: "list[PwaCurve]") -> "ShownTable":
    from rich import box

    from qpmpc.report.table import ShownTable

    table = ShownTable(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    table.add_column("curve", overflow="fold")
    table.add_column("pieces", justify="right")
    table.add_column("breakpoints", overflow="fold")
    table.add_column("at most below", justify="right", no_wrap=True)
    table.add_column("at most above", justify="right", no_wrap=True)
    for curve in curves:
        table.add_row(
            f"{curve.title}: {curve.x_label} -> {curve.y_label}",
            str(curve.fit.pieces),
            " ".join(f"{x / curve.x_unit:.5g}" for x in curve.fit.breakpoints),
            f"{curve.fit.below / curve.y_unit:.3g} {curve.y_unit_name}",
            f"{curve.fit.above / curve.y_unit:.3g} {curve.y_unit_name}",
        )
    return table
