"""``qpmpc trips``: the random trips beside the shipped cycles."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from qpmpc.cli.completion import complete_set
from qpmpc.cli.options import JsonOption, OutOption

if TYPE_CHECKING:
    from qpmpc.cycles import Cycle


def trips(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="SET|TRIP",
            autocompletion=complete_set,
            help="One set, or one trip of any set.",
            show_default=False,
        ),
    ] = None,
    out: OutOption = None,
    json_file: JsonOption = None,
) -> None:
    """Show the random trips, statistics of the sets beside those of the shipped cycles.

    The sets are train and judge, with the trips train-000 .. train-199 and judge-000 .. judge-199;
    any other trip is random-SEED or random-SEED-SECONDSs.

    With --out: trips as CSV, and a picture of the trip or of the set.

    For example:

      qpmpc trips

      qpmpc trips judge-017 --out results

      qpmpc trips train --out results --json train.json

      qpmpc trips random-5-600s
    """
    from qpmpc.cli.console import progress_bar, result_console, write_json
    from qpmpc.cli.inputs import check_outputs
    from qpmpc.cycles import cycle_names, load_cycle
    from qpmpc.cycles.trips import ALLOWED, SETS, is_trip, make_trip, near_trips, set_names
    from qpmpc.errors import InputError
    from qpmpc.names import unknown
    from qpmpc.report.table import print_rows
    from qpmpc.report.trip_set import SET_COLUMNS, TRIP_COLUMNS, cycle_row, quantile_rows
    from qpmpc.report.write import write_trip_set, write_trips

    if name is None and out is not None:
        raise InputError("--out writes one set or trip: name it, e.g. qpmpc trips train --out DIR")
    if name is not None and name not in SETS and not is_trip(name):
        raise InputError(unknown("trip or set", name, SETS, f", {ALLOWED}", near_trips(name)))
    check_outputs(json_file, out)
    console = result_console(json_file)
    if name is not None and name not in SETS:
        trip = make_trip(name)
        row = _trip_row(trip)
        print_rows(console, [row], TRIP_COLUMNS, section="name")
        write_json({"trips": [row]}, json_file)
        for remark in write_trips([trip], out) if out is not None else ():
            console.print(remark)
        return
    shipped = [cycle_row(load_cycle(known)) for known in cycle_names()]
    sets = tuple(SETS) if name is None else (name,)
    made: list[Cycle] = []
    of_set: dict[str, list[dict[str, Any]]] = {}
    with progress_bar(len(sets)) as bar:
        for each in sets:
            report = bar.next_job(each)
            names = set_names(each)
            of_set[each] = []
            for i, trip_name in enumerate(names):
                made.append(make_trip(trip_name))
                of_set[each].append(_trip_row(made[-1]))
                report(i + 1, len(names))
    quantiles = [row for each in sets for row in quantile_rows(each, of_set[each])]
    print_rows(
        console,
        [{**row, "section": row["name"] if "quantile" in row else ""} for row in shipped]
        + [{**row, "section": row["name"]} for row in quantiles],
        SET_COLUMNS,
        section="section",
    )
    rows = [row for each in sets for row in of_set[each]]
    write_json({"cycles": shipped, "sets": quantiles, "trips": rows}, json_file)
    if out is not None and name is not None:
        for remark in (*write_trips(made, out), *write_trip_set(name, rows, shipped, out)):
            console.print(remark)


def _trip_row(trip: "Cycle") -> dict[str, Any]:
    from qpmpc.cycles.trips.make import plan_of
    from qpmpc.report.trip_set import cycle_row

    plan = plan_of(trip.name)
    row = cycle_row(trip)
    return {"name": row.pop("name"), "type": f"{plan.kind}, {plan.ground}", **row}
