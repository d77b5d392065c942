"""``qpmpc cycles``: the shipped cycles, measured and as published."""

from typing import TYPE_CHECKING, Annotated

import typer

from qpmpc.cli.completion import complete_cycle
from qpmpc.cli.options import OutOption

if TYPE_CHECKING:
    from rich.console import Console

    from qpmpc.cycles import CatalogueEntry, Cycle, Figure


def cycles(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME|FILE.csv",
            autocompletion=complete_cycle,
            help="Show details of this one.",
            show_default=False,
        ),
    ] = None,
    out: OutOption = None,
) -> None:
    """List the shipped cycles, measured on the files against the published statistics.

    With --out: a picture of the cycle.

    For example:

      qpmpc cycles

      qpmpc cycles wltc-3b --out results

      qpmpc cycles my_trip.csv
    """
    from qpmpc.cli.console import result_console
    from qpmpc.cli.inputs import check_outputs
    from qpmpc.cycles import catalogue, load_cycle
    from qpmpc.cycles.load import CYCLES
    from qpmpc.errors import InputError
    from qpmpc.report.write import write_cycle

    if name is None and out is not None:
        raise InputError("--out draws one cycle: name it, e.g. qpmpc cycles nycc --out results")
    check_outputs(None, out)
    console = result_console()
    entries = {entry.name: entry for entry in catalogue()}
    if name is None:
        _list(console, [(load_cycle(known), entries.get(known)) for known in CYCLES.names()])
        return
    cycle = load_cycle(name)
    entry = entries.get(name)
    _list(console, [(cycle, entry)])
    for title in ("title", "source", "licence", "note") if entry else ():
        text = getattr(entry, title)
        if text:
            console.print(f"{title}: {text}")
    for remark in cycle.remarks:
        console.print(remark)
    if out is not None:
        for remark in write_cycle(cycle, out):
            console.print(remark)


def _list(console: "Console", rows: "list[tuple[Cycle, CatalogueEntry | None]]") -> None:
    from rich import box

    from qpmpc.report.table import ShownTable

    table = ShownTable(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    table.add_column("cycle", overflow="fold")
    for title in ("duration", "distance", "mean speed", "max speed"):
        table.add_column(title, justify="right", no_wrap=True)
    for i, (cycle, entry) in enumerate(rows):
        published = entry.published if entry else None
        table.add_row(cycle.name, *_measured(cycle))
        if published:
            figures = (
                published.duration,
                published.distance,
                published.speed_mean,
                published.speed_max,
            )
            table.add_row("  published", *map(_published, figures), style="dim")
        if i + 1 < len(rows):
            table.add_section()
    console.print(table)


def _measured(cycle: "Cycle") -> tuple[str, ...]:
    mean_mps = cycle.distance_m / cycle.duration_s
    return (
        f"{cycle.duration_s:.0f} s",
        f"{cycle.distance_m / 1e3:.3f} km",
        f"{mean_mps * 3.6:.2f} km/h",
        f"{cycle.speed_mps.max() * 3.6:.1f} km/h",
    )


def _published(figure: "Figure") -> str:
    """Figure as printed, and in the unit of the measured one where that differs."""
    km, kmh = figure.si / 1e3, figure.si * 3.6
    converted = {"mi": f" = {km:.3f} km", "mph": f" = {kmh:.2f} km/h"}
    return f"{figure}{converted.get(figure.unit, '')}"
