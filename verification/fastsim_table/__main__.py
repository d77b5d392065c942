"""``python -m qpmpc.verification.fastsim_table [PAGE]``: write the table of docs/fastsim.md anew.

Every cycle on FASTSim's plant, with both engines.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from qpmpc.comparison import compare
from qpmpc.files import around_marks, write_text

BEGIN = "<!-- fastsim: written by python -m qpmpc.verification.fastsim_table -->"
END = "<!-- end -->"

CYCLES = ("udds", "hwfet", "wltc-3b", "nycc")
OWN = "fastsim"
ENGINE_OF = "prius-nimh"  # whose map is not FASTSim's
# Controllers, the car that gives their engine if not FASTSim, settings, and what a row is called.
ROWS: tuple[tuple[tuple[str, ...], str | None, dict[str, object], str], ...] = (
    ((OWN, "rule-based", "ecms", "mh-qp", "dp"), None, {}, "{}"),
    (("rule-based", "mh-qp"), ENGINE_OF, {}, f"{{}}, engine of {ENGINE_OF}"),
    (("mh-qp",), ENGINE_OF, {"mh_qp.learning": True}, f"{{}}, engine of {ENGINE_OF}, learned"),
    (("mh-qp",), None, {"engine.min_on_s": 0}, "{}, engine free to stop"),
)
DP_GRID = {"dp.grid": "quick"}  # ten times as fast, and off by less than what is at stake here

Rows = list[tuple[str, dict[str, Any]]]


def measured(cycles: Sequence[str] = CYCLES) -> Rows:
    """Drive all; return a label and the figures of each run, cycle by cycle."""
    found: Rows = []
    for controllers, engine_of, settings, label in ROWS:
        chosen = settings | (DP_GRID if "dp" in controllers else {})
        runs = compare(cycles, controllers, engine_of, settings=chosen, plant=OWN)
        found += [(label.format(row["controller"]), row) for row in runs.rows()]
    return sorted(found, key=lambda pair: list(cycles).index(pair[1]["cycle"]))


def table(rows: Rows) -> str:
    """Return the rows as a Markdown table."""
    own = {row["cycle"]: row["fuel_soc_balanced_g"] for _, row in rows if row["controller"] == OWN}
    text = (
        "| cycle | controller | balanced g | below FASTSim's own % | SOC | starts | not obeyed s |"
    )
    text += " off trace s |\n|---|---|---:|---:|---:|---:|---:|---:|\n"
    for label, row in rows:
        fuel_g, cycle = row["fuel_soc_balanced_g"], row["cycle"]
        mark = "" if row["comparable"] else "\\*"
        plant = row["plant"]
        text += (
            f"| {cycle} | {label} | {fuel_g:.1f}{mark} | {100 * (1 - fuel_g / own[cycle]):.1f} "
            f"| {row['soc_min']:.3f}..{row['soc_max']:.3f} | {row['engine_starts']} "
            f"| {plant['seconds_not_obeyed']} | {plant['seconds_off_trace']} |\n"
        )
    return text


def main(arguments: list[str] | None = None) -> int:
    """Write the table between the marks of a page; see the module."""
    parser = argparse.ArgumentParser(prog="python -m qpmpc.verification.fastsim_table")
    parser.add_argument("page", type=Path, nargs="?", default=Path("docs/fastsim.md"))
    page = parser.parse_args(arguments).page
    before, after = around_marks(page, BEGIN, END)
    write_text(page, f"{before}\n\n{table(measured())}\n{after}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
