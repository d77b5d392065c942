"""``qpmpc vehicle-from-map``: a vehicle file with the engine of a measured map or curve."""

from pathlib import Path
from typing import Annotated

import typer

from qpmpc.cli.completion import complete_vehicle
from qpmpc.cli.options import JsonOption

DOUBTFUL = 0.15  # best efficiency below which a unit is probably wrong


def vehicle_from_map(
    engine: Annotated[
        Path,
        typer.Argument(
            metavar="MAP.csv",
            help="The hot engine: a map (speed, torque, fuel) or a curve (power, fuel); fuel in "
            "g/s, kg/h, g/kWh or as an efficiency, units in the header.",
            show_default=False,
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(
            "--out", metavar="CAR.toml", help="Vehicle file to write.", show_default=False
        ),
    ],
    base: Annotated[
        str,
        typer.Option(
            "--base",
            metavar="NAME|FILE.toml",
            autocompletion=complete_vehicle,
            help="The vehicle that gives all but the engine.",
        ),
    ] = "prius-nimh",
    name: Annotated[
        str | None,
        typer.Option(
            "--name", help="Name of the vehicle; that of the file if absent.", show_default=False
        ),
    ] = None,
    json_file: JsonOption = None,
) -> None:
    """Make a vehicle file from an engine map: its optimal operating line, in any other car.

    At each power the line has the speed of least fuel within the torque limit. A picture beside
    the file (CAR.png) shows map, line, and how far the controllers' piecewise-affine model is off.

    For example:

      qpmpc vehicle-from-map my_engine.csv --base prius-nimh --out my_car.toml

      qpmpc compare nycc --vehicle my_car.toml
    """
    from qpmpc.cli.console import result_console, write_json
    from qpmpc.cli.inputs import STDOUT, check_outputs
    from qpmpc.errors import InputError
    from qpmpc.files import check_file, write_text
    from qpmpc.pwa.fit import non_convexity
    from qpmpc.report.pwa_curves import pwa_curves
    from qpmpc.report.write import write_engine
    from qpmpc.vehicle.from_map import vehicle_from_map as made

    if out.suffix != ".toml":
        raise InputError(f"--out {out}: a vehicle file ends in .toml")
    check_outputs(json_file, None)
    picture = out.with_suffix(".png")
    check_file(out, "--out")
    check_file(picture, "--out")
    files = [engine, out, picture, *([json_file] if json_file not in (None, STDOUT) else [])]
    files += [Path(base)] if base.endswith(".toml") else []
    if len({file.resolve() for file in files}) < len(files):
        raise InputError(
            "MAP.csv, --base, --out, its picture and --json must be files of their own: "
            f"{', '.join(str(file) for file in files)}"
        )
    mapped = made(engine, base, out.stem if name is None else name)
    fuel = pwa_curves(mapped.vehicle)[0]
    write_text(out, mapped.toml)
    console = result_console(json_file)
    console.print(
        f"{mapped.vehicle.name}: {mapped.vehicle.engine.power_max_w / 1e3:.1f} kW, best "
        f"{mapped.best_efficiency:.1%} at {mapped.best_power_w / 1e3:.3g} kW, idle "
        f"{mapped.line.fuel_g_per_s[0]:.3g} g/s"
    )
    console.print(
        f"controllers' model: {fuel.fit.pieces} pieces, at most {fuel.fit.below:.2g} g/s below and "
        f"{fuel.fit.above:.2g} above the line"
    )
    lost, at_w = non_convexity(fuel.x, fuel.y)
    if lost > 0.0:
        console.print(
            f"the line is not convex: the convex model is up to {100.0 * lost:.2g} % of fuel below "
            f"it, at {at_w / 1e3:.3g} kW"
        )
    if mapped.best_efficiency < DOUBTFUL:
        console.print(
            f"remark: at best {mapped.best_efficiency:.1%} efficient, less than engines are: are "
            "the units right?"
        )
    for remark in mapped.remarks:
        console.print(f"remark: {remark}")
    for said in [*write_engine(mapped, fuel, picture), f"{out} written"]:
        console.print(said)
    model = {
        "pwa_pieces": fuel.fit.pieces,
        "pwa_below_g_per_s": fuel.fit.below,
        "pwa_above_g_per_s": fuel.fit.above,
        "non_convex_percent": 100.0 * lost,
        "non_convex_at_w": at_w,
    }
    write_json(mapped.summary() | model, json_file)
