"""Lines, CSV, JSON, picture and HTML page of a board's log."""

from base64 import b64encode
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from qpmpc.codegen.board.check import SHOWN_SECONDS, BoardResult
from qpmpc.codegen.pil.report import NO_MATPLOTLIB
from qpmpc.controllers.monitor import Flag
from qpmpc.files import json_text, write_bytes, write_text
from qpmpc.report.csv_text import csv_text
from qpmpc.report.html import html_page
from qpmpc.report.provenance import provenance
from qpmpc.report.table import ShownTable

NONE = "-"
PARTS = {"step": "mpc_step", "forecast": "mpc_in_from_forecast", "both": "both, a second"}


def board_heading(data: dict[str, Any]) -> str:
    """Return what was replayed where, in a line."""
    of_trip = "" if data["seconds"] == data["trip_s"] else f" of {data['trip_s']}"
    method = "" if data["algorithm"] == "costate" else f" ({data['algorithm']})"
    return (
        f"{data['cycle']}: {data['seconds']}{of_trip} s on {data['board']}, {data['controller']}"
        f"{method} {data['precision']}, {data['iterations']} iterations per step"
    )


def board_table(data: dict[str, Any]) -> ShownTable:
    """Return the times for the terminal."""
    table = ShownTable(title=board_heading(data))
    table.add_column(data["unit"])
    for name in HEADER[1:]:
        table.add_column(name, justify="right")
    for row in board_rows(data):
        table.add_row(*row)
    return table


HEADER = ("", "median", "p99", "max", "min", "spread %", "median ms", "max ms", "max % of 1 s")


def board_rows(data: dict[str, Any]) -> list[list[str]]:
    """Return the times as cells, a row for each part of a second."""
    return [
        [
            title,
            f"{times['median']:,.0f}",
            *(f"{times[key]:,}" for key in ("p99", "max", "min")),
            *(
                _figure(times[key], digits)
                for key, digits in (
                    ("spread_percent", ".3f"),
                    ("median_ms", ".4g"),
                    ("max_ms", ".4g"),
                    ("max_share_of_second_percent", ".3g"),
                )
            ),
        ]
        for key, title in PARTS.items()
        for times in [data["times"][key]]
    ]


def board_lines(data: dict[str, Any]) -> list[str]:
    """Return everything but the times as lines of text."""
    commands, departure = data["commands"], data["departure"]
    differ = commands["differ_by_more"]
    more = ", ..." if len(differ) > SHOWN_SECONDS else ""
    at = f" (at {', '.join(map(str, differ[:SHOWN_SECONDS]))}{more} s)" if differ else ""
    clock = {"ns": "wall", "instructions": "none, an emulator"}.get(data["unit"], "not known")
    if data["clock_mhz"] is not None:
        clock = f"{data['clock_mhz']:g} MHz"
    lines = [
        f"commands             {commands['equal_to_the_bit']} of {data['seconds']} equal this "
        f"machine's to the bit ({commands['engine_on_equal_to_the_bit']} of "
        f"{commands['engine_on_seconds']} with the engine on), the others to "
        f"{commands['largest_difference_w']:.3g} W at most where both run it; "
        f"{len(differ)} differ by more than rounding explains, "
        f"{commands['tolerance_w']:,.0f} W, or in on and off{at}",
        f"clock                {clock}",
    ]
    if departure["slices"]:
        in_ms = "" if departure["max_ms"] is None else f" ({departure['max_ms']:.4g} ms)"
        lines.append(
            f"before the trip      {departure['slices']} slices, at most {departure['max']:,} "
            f"{data['unit']}{in_ms} each"
        )
    whole = [
        f"{name} {data[key]:,} B" if data[key] else f"{name} not known"
        for name, key in (
            ("stack", "stack_bytes"),
            ("flash", "flash_bytes"),
            ("RAM with stack", "ram_bytes"),
        )
    ]
    lines += [
        f"memory               one controller {data['state_bytes']:,} B, its forecast "
        f"{data['forecast_bytes']:,} B; of the program {', '.join(whole)}",
        f"fallback, flags      {data['fallback_seconds']} s, {data['flagged_seconds']} s",
        f"program              identity {data['identity']}, made by qpmpc-iptm {data['version']}",
    ]
    return [*lines, *data["remarks"]]


def board_answer(data: dict[str, Any]) -> list[str]:
    """Return whether the board computes what this machine does, and in what time."""
    commands, worst = data["commands"], data["times"]["both"]
    differ, seconds = len(commands["differ_by_more"]), data["seconds"]
    if differ:
        first = f"{differ} of {seconds} commands differ from this machine's by more than round-off."
    elif commands["equal_to_the_bit"] == seconds:
        first = f"All {seconds} commands equal this machine's to the bit."
    else:
        first = (
            f"All {seconds} commands agree with this machine's, "
            f"{commands['equal_to_the_bit']} of them to the bit."
        )
    share = worst["max_share_of_second_percent"]
    took = "" if share is None else f", {share:.3g} % of it"
    return [
        first,
        f"The longest second took {worst['max']:,} {data['unit']}{took}.",
        f"A fallback drove in {data['fallback_seconds']} s."
        if data["fallback_seconds"]
        else "No fallback drove.",
    ]


def write_board(result: BoardResult, folder: Path) -> list[str]:
    """Write seconds, figures and, with matplotlib, picture and report; returns remarks."""
    data = result.summary()
    stem = f"board_{data['cycle']}_{data['controller']}_{data['precision']}"
    write_text(folder / f"{stem}.csv", _csv(result))
    write_text(folder / f"{stem}.json", json_text(data))
    if find_spec("matplotlib") is None:
        return [f"{folder / stem}.csv, .json written; {NO_MATPLOTLIB}"]
    from qpmpc.codegen.board.picture import board_chart, draw_board

    picture = draw_board(result)
    write_bytes(folder / f"{stem}.png", picture)
    page = html_page(
        "qpmpc.codegen.board",
        "board.html.j2",
        title=board_heading(data),
        answer=board_answer(data),
        chart=board_chart(result),
        vehicle=data["vehicle"],
        unit=data["unit"],
        header=HEADER[1:],
        rows=board_rows(data),
        lines=board_lines(data),
        picture=b64encode(picture).decode(),
        provenance=provenance(),
    )
    write_text(folder / f"{stem}.html", page)
    return [f"{folder / stem}.csv, .json, .png, .html written"]


def _figure(value: float | None, digits: str) -> str:
    return NONE if value is None else format(value, digits)


def _csv(result: BoardResult) -> str:
    log, expected = result.log, result.expected
    header = (
        f"time_s,step_{log.unit},forecast_{log.unit},engine_on,p_eng_w,expected_engine_on,"
        "expected_p_eng_w,status"
    )
    rows = [
        [
            k,
            log.step[k],
            log.forecast[k],
            int(log.engine_on[k]),
            f"{log.power_w[k]:.9g}",
            int(expected.engine_on[k]),
            f"{expected.power_w[k]:.9g}",
            "; ".join(Flag(flags).names()) or "ok",
        ]
        for k, flags in enumerate(log.flags.tolist())
    ]
    return csv_text(header.split(","), rows)
