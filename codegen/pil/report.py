"""Table, CSV, JSON, picture and HTML page of processor-in-the-loop runs."""

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from qpmpc.codegen.pil.loop import PilResult
from qpmpc.codegen.pil.pareto import Pareto
from qpmpc.controllers.monitor import Flag
from qpmpc.controllers.settings import MhQpSettings
from qpmpc.files import json_text, write_bytes, write_text
from qpmpc.report.columns import violations_text
from qpmpc.report.csv_text import csv_text
from qpmpc.report.table import ShownTable

FLIPS_SHOWN = 8
NO_MATPLOTLIB = (
    "no picture and no report: matplotlib is not installed (pip install 'qpmpc-iptm[plot]')"
)


def pil_lines(result: PilResult) -> list[str]:
    """Return the figures of a run as lines of text."""
    data = result.summary()
    counts, departure = data["instructions"], data["departure"]
    lines = [
        f"{data['cycle']}: {data['steps']} steps on {data['target']}, {data['precision']}, "
        f"algorithm {data['algorithm']}, {data['iterations']} iterations per step, "
        f"{data['steps_per_s']:.0f} steps/s here",
        f"instructions/step    {counts['median']:,} median, {counts['min']:,}..{counts['max']:,} "
        f"(spread {counts['spread_percent']:.3f} %)",
    ]
    if departure["slices"]:
        lines.append(
            f"before the trip      {departure['slices']} slices, at most "
            f"{departure['instructions_max']:,} instructions each"
        )
    lines.append("ms per step, estimated cycles per instruction 1.0 / 1.5 / 2.5")
    rows = data["milliseconds_estimated"]
    for clock in dict.fromkeys(row["clock_mhz"] for row in rows):
        times = [f"{r['milliseconds']:.2f}" for r in rows if r["clock_mhz"] == clock]
        lines.append(f"  {clock:4d} MHz           {' / '.join(times)}")
    lines += [
        f"memory               flash {data['flash_bytes']:,} B, RAM {data['ram_bytes']:,} B "
        f"(one controller {data['state_bytes']:,} B), stack {data['stack_bytes']} B used, "
        f"{data['stack_bytes_call_graph']} B by call graph",
        f"fuel, SOC-balanced   {data['fuel_soc_balanced_g']:.3f} g, Python alone "
        f"{data['fuel_soc_balanced_g_python']:.3f} g ({data['fuel_difference_percent']:+.4f} %)",
        f"violations           {violations_text(data)}, fallback steps {data['fallback_steps']}",
        f"command error        {data['max_command_error_w']:.3g} W at most against Python f64 in "
        f"the same state; {data['max_command_error_w_same_engine_state']:.3g} W where both have "
        "the engine on or off",
    ]
    flips = result.flips
    if len(flips):
        on_share = result.run.trajectory.on_share
        places = flips[:FLIPS_SHOWN].tolist()
        shown = ", ".join(f"{k} s (on-share {on_share[k]:.2f})" for k in places)
        more = ", ..." if len(flips) > FLIPS_SHOWN else ""
        lines.append(f"on/off differs at    {shown}{more}")
    return lines


def write_pil(result: PilResult, folder: Path) -> list[str]:
    """Write steps, figures and, with matplotlib, picture and report; returns remarks."""
    algorithm = "" if result.algorithm == "admm" else f"_{result.algorithm}"
    stem = f"pil_{result.run.cycle}_{result.precision}{algorithm}"
    write_text(folder / f"{stem}.csv", _csv(result))
    write_text(folder / f"{stem}.json", json_text(result.summary()))
    if find_spec("matplotlib") is None:
        return [f"{folder / stem}.csv, .json written; {NO_MATPLOTLIB}"]
    from qpmpc.codegen.pil.page import pil_page
    from qpmpc.codegen.pil.pictures import draw_pil

    picture = draw_pil(result)
    write_bytes(folder / f"{stem}.png", picture)
    page = pil_page(result, pil_lines(result), [result.summary()], picture)
    write_text(folder / f"{stem}.html", page)
    return [f"{folder / stem}.csv, .json, .png, .html written"]


def write_pareto(pareto: Pareto, folder: Path) -> list[str]:
    """Write figures and, with matplotlib, picture and report; returns remarks.

    The run shown in detail is the one whose iterations are nearest to the default.
    """
    data = pareto.as_data()
    stem = f"pareto_{data['runs'][0]['cycle']}"
    write_text(folder / f"{stem}.json", json_text(data))
    if find_spec("matplotlib") is None:
        return [f"{folder / stem}.json written; {NO_MATPLOTLIB}"]
    from qpmpc.codegen.pil.page import pil_page
    from qpmpc.codegen.pil.pictures import draw_pareto, draw_pil

    default = MhQpSettings().admm.iterations
    shown = min(pareto.results, key=lambda result: abs(result.iterations - default))
    picture = draw_pareto(data["runs"])
    write_bytes(folder / f"{stem}.png", picture)
    page = pil_page(
        shown, pil_lines(shown), data["runs"], draw_pil(shown), picture, pareto.dp_fuel_g
    )
    write_text(folder / f"{stem}.html", page)
    return [f"{folder / stem}.json, .png, .html written"]


def pareto_table(rows: Sequence[dict[str, Any]]) -> ShownTable:
    """Return one line per run for the terminal."""
    table = ShownTable(title=f"{rows[0]['cycle']}: fuel against instructions on a Cortex-M7")
    for name in ("algorithm", "precision"):
        table.add_column(name)
    for name in ("K", "instructions per step", "spread %", "flash B", "RAM B", "above DP %"):
        table.add_column(name, justify="right")
    table.add_column("remark")
    for row in rows:
        remarks = [f"{key} exceeded" for key, value in row["violations"].items() if value > 0]
        remarks += [f"fallback {row['fallback_steps']} s"] if row["fallback_steps"] else []
        flips = len(row["on_off_flips"])
        remarks += [f"on/off differs from Python in {flips} steps"] if flips else []
        table.add_row(
            row["algorithm"],
            row["precision"],
            f"{row['iterations']}",
            f"{row['instructions']['median']:,}",
            f"{row['instructions']['spread_percent']:.3f}",
            f"{row['flash_bytes']:,}",
            f"{row['ram_bytes']:,}",
            f"{row['fuel_above_dp_percent']:.2f}",
            ", ".join(remarks),
        )
    return table


def _csv(result: PilResult) -> str:
    header = "time_s,instructions,engine_on,p_eng_w,python_engine_on,python_p_eng_w,status"
    rows = [
        [
            k,
            result.instructions[k],
            int(result.command_on[k]),
            f"{result.command_w[k]:.6g}",
            int(result.reference_on[k]),
            f"{result.reference_w[k]:.6g}",
            "; ".join(Flag(flags).names()) or "ok",
        ]
        for k, flags in enumerate(result.flags.tolist())
    ]
    return csv_text(header.split(","), rows)
