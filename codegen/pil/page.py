"""The page of processor-in-the-loop runs; it needs matplotlib for its colours."""

from base64 import b64encode
from collections.abc import Sequence
from typing import Any

from qpmpc.codegen.pil.loop import PilResult
from qpmpc.codegen.pil.pictures import LINES
from qpmpc.report.charts import Panel, Series, dashes, groups_of, held, lines, only, over_time
from qpmpc.report.columns import violations_text
from qpmpc.report.html import html_page
from qpmpc.report.provenance import provenance
from qpmpc.report.style import BLACK, BLUE, GREY, VERMILION

SHOWN_CYCLES_AN_INSTRUCTION = 1.5


def pil_page(
    shown: PilResult,
    lines: Sequence[str],
    rows: Sequence[dict[str, Any]],
    run_picture: bytes,
    pareto_picture: bytes = b"",
    dp_fuel_g: float = 0.0,
) -> str:
    """Return the report: one self-contained page.

    Parameters
    ----------
    shown, lines : the run shown in detail, and its figures as text
    rows : figures of all runs
    run_picture, pareto_picture : PNG
    """
    return html_page(
        "qpmpc.codegen.pil",
        "pil.html.j2",
        title=f"{shown.run.cycle}: the controller on a Cortex-M7",
        answer=pil_answer(rows),
        vehicle=shown.run.vehicle,
        rows=rows,
        times=shown_times(rows[0]),
        lines=lines,
        run_picture=b64encode(run_picture).decode(),
        run_chart=_run_chart(shown),
        pareto_picture=b64encode(pareto_picture).decode(),
        pareto_chart=_pareto_chart(rows) if pareto_picture else None,
        dp_fuel_g=dp_fuel_g,
        provenance=provenance(),
    )


def shown_times(row: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the estimated milliseconds that a page shows, one per clock."""
    return [
        time
        for time in row["milliseconds_estimated"]
        if time["cycles_per_instruction"] == SHOWN_CYCLES_AN_INSTRUCTION
    ]


def pil_answer(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Return what a step costs and whether the firmware drove as Python does."""
    if len(rows) > 1:
        sound = [row for row in rows if _is_sound(row)]
        if not sound:
            return [f"None of {len(rows)} runs kept all limits without a fallback."]
        least = min(sound, key=lambda row: row["instructions"]["max"])
        best = min(sound, key=lambda row: row["fuel_above_dp_percent"])
        sentences = [f"The cheapest step: {_cost(least)}, {_above(least)}."]
        if best is not least:
            sentences.append(f"The least fuel: {_cost(best)}, {_above(best)}.")
        left = len(rows) - len(sound)
        if left:
            sentences.append(f"{left} of {len(rows)} runs violated a limit or used a fallback.")
        return sentences
    (row,) = rows
    time = shown_times(row)[-1]
    violated, fallback = any(row["violations"].values()), row["fallback_steps"]
    flips = len(row["on_off_flips"])
    return [
        f"A step takes {row['instructions']['max']:,} instructions at most, an estimated "
        f"{time['milliseconds']:.2f} ms at {time['clock_mhz']} MHz; fuel "
        f"{_against_python(row['fuel_difference_percent'])}.",
        f"Limits were violated: {violations_text(row)}." if violated else "No limit was violated.",
        f"A fallback drove in {fallback} of {row['steps']} s."
        if fallback
        else "No fallback drove.",
        *([f"Engine on and off differ from Python in {flips} s."] if flips else []),
    ]


def _is_sound(row: dict[str, Any]) -> bool:
    return not any(row["violations"].values()) and not row["fallback_steps"]


def _cost(row: dict[str, Any]) -> str:
    return (
        f"{row['algorithm']} {row['precision']} with {row['iterations']} iterations, "
        f"{row['instructions']['max']:,} instructions at most"
    )


def _above(row: dict[str, Any]) -> str:
    return f"fuel {row['fuel_above_dp_percent']:.2f} % above dynamic programming"


def _against_python(percent: float) -> str:
    text = f"{abs(percent):.4f}"
    if float(text) == 0.0:
        return "equals that of the controller in Python to 0.0001 %"
    return f"is {text} % {'below' if percent < 0.0 else 'above'} that of the controller in Python"


def _run_chart(result: PilResult) -> dict[str, Any]:
    count = result.instructions / 1e6
    power = [
        Series("Python f64", held(result.reference_w / 1e3), GREY, "Python f64", stepped=True),
        Series(
            result.precision,
            held(result.command_w / 1e3),
            VERMILION,
            result.precision,
            stepped=True,
        ),
    ]
    panels = [
        Panel(
            "instructions per step, millions",
            [Series("step", held(count), BLUE, stepped=True)],
            zero=True,
        ),
        Panel("engine power, kW", power),
        Panel("command error, W", [Series("error", held(result.command_error_w), BLACK)]),
    ]
    return over_time(panels, [each.as_group() for each in power])


def _pareto_chart(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    rows = sorted(rows, key=lambda row: float(row["instructions"]["median"]))
    present = {(row["algorithm"], row["precision"]) for row in rows}
    families = {key: style for key, style in LINES.items() if key in present}
    series = []
    above = [row["fuel_above_dp_percent"] for row in rows]
    millions = [row["instructions"]["median"] / 1e6 for row in rows]
    for key, (color, style) in families.items():
        own = [(row["algorithm"], row["precision"]) == key for row in rows]
        name = " ".join(key)
        line = Series(name, only(above, own), color, name, dashes(style), joined=True, size=8)
        series.append(line)
    panel = Panel(
        "SOC-balanced fuel above DP, %",
        series,
        zero=True,
        height=320,
        labels=[
            f"{row['algorithm']} {row['precision']}, K = {row['iterations']}: {count:.3g} million "
            f"instructions, {percent:.2f} % above DP"
            for row, count, percent in zip(rows, millions, above, strict=True)
        ],
        texts=[f"K = {row['iterations']}" for row in rows],
    )
    label = "instructions per step, millions"
    return lines(millions, label, "millions", [panel], groups_of([panel]), True)
