"""Table, CSV, JSON and picture of a processor-in-the-loop run."""

from importlib.util import find_spec
from pathlib import Path

import numpy as np

from qpmpc.codegen.controller import FLAGS
from qpmpc.codegen.pil import PilResult
from qpmpc.files import json_text, write_bytes, write_text
from qpmpc.report.columns import violations_text

FLIPS_SHOWN = 8


def pil_lines(result: PilResult) -> list[str]:
    """Return the figures of a run as lines of text."""
    data = result.summary()
    counts, departure = data["instructions"], data["departure"]
    lines = [
        f"{data['cycle']}: {data['steps']} steps on {data['target']}, {data['precision']}, "
        f"solver {data['solver']}, {data['iterations']} iterations a step, "
        f"{data['steps_per_s']:.0f} steps/s here",
        f"instructions a step  {counts['median']:,} median, {counts['min']:,}..{counts['max']:,} "
        f"(spread {counts['spread_percent']:.3f} %)",
    ]
    if departure["slices"]:
        lines.append(
            f"before the trip      {departure['slices']} slices, at most "
            f"{departure['instructions_max']:,} instructions each"
        )
    lines.append("ms a step, estimated cycles per instruction 1.0 / 1.5 / 2.5")
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
        sigma = result.run.trajectory.sigma
        shown = ", ".join(f"{k} s (sigma {sigma[k]:.2f})" for k in flips[:FLIPS_SHOWN].tolist())
        more = ", ..." if len(flips) > FLIPS_SHOWN else ""
        lines.append(f"on/off differs at    {shown}{more}")
    return lines


def write_pil(result: PilResult, folder: Path) -> list[str]:
    """Write steps, figures and, with matplotlib, the picture; returns remarks."""
    solver = "" if result.solver == "admm" else f"_{result.solver}"
    stem = f"pil_{result.run.cycle}_{result.precision}{solver}"
    write_text(folder / f"{stem}.csv", _csv(result))
    write_text(folder / f"{stem}.json", json_text(result.summary()))
    if find_spec("matplotlib") is None:
        return [f"{folder / stem}.csv, .json written; no picture: matplotlib is not installed"]
    write_bytes(folder / f"{stem}.png", draw_pil(result))
    return [f"{folder / stem}.csv, .json, .png written"]


def _csv(result: PilResult) -> str:
    lines = ["time_s,instructions,engine_on,p_eng_w,python_engine_on,python_p_eng_w,status"]
    for k, flags in enumerate(result.flags.tolist()):
        status = "; ".join(text for bit, text in FLAGS.items() if flags & bit) or "ok"
        lines.append(
            f"{k},{result.instructions[k]},{int(result.command_on[k])},"
            f"{result.command_w[k]:.6g},{int(result.reference_on[k])},"
            f"{result.reference_w[k]:.6g},{status}"
        )
    return "\n".join(lines) + "\n"


def draw_pil(result: PilResult) -> bytes:
    """Draw instructions a step, engine power and command error over time.

    Returns
    -------
    PNG
    """
    from matplotlib.figure import Figure

    from qpmpc.report.style import BLACK, BLUE, GREY, VERMILION, png, tidy

    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    counts, power, error = figure.subplots(3, 1, sharex=True)
    time_s = np.arange(len(result.instructions))
    counts.plot(time_s, result.instructions / 1e6, color=BLUE, linewidth=0.9)
    counts.set_ylim(bottom=0.0)
    counts.set_ylabel("instructions\nmillions a step")
    power.plot(time_s, result.reference_w / 1e3, color=GREY, linewidth=1.6, label="Python f64")
    power.plot(
        time_s, result.command_w / 1e3, color=VERMILION, linewidth=0.8, label=result.precision
    )
    power.set_ylabel("engine power\nkW")
    power.legend(fontsize=8, frameon=False)
    least = 1e-3
    error.semilogy(
        time_s, np.maximum(result.command_error_w, least), ".", color=BLACK, markersize=3
    )
    flips = result.flips
    error.semilogy(
        flips,
        np.maximum(result.command_error_w[flips], least),
        "o",
        color=VERMILION,
        markersize=5,
        label="engine on in one, off in the other",
    )
    error.set_ylabel(f"command error\nW (at least {least:g} shown)")
    error.legend(fontsize=8, frameon=False)
    error.set_xlabel("time, s")
    for axes in (counts, power, error):
        tidy(axes)
    figure.suptitle(
        f"{result.run.cycle}: controller on {result.target} in QEMU, {result.precision}, "
        f"solver {result.solver}",
        fontsize=11,
    )
    return png(figure)
