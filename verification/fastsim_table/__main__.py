"""``python -m qpmpc.verification.fastsim_table [PAGE]``: write the tables of docs/fastsim.md anew.

Every cycle on FASTSim's cars, with their own engines and with another car's.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from qpmpc.comparison import compare
from qpmpc.files import around_marks, write_text

BEGIN = "<!-- {plant}: written by python -m qpmpc.verification.fastsim_table -->"
END = "<!-- end of {plant} -->"

CYCLES = ("udds", "hwfet", "wltc-3b", "nycc")
PRIUS, SONATA = "fastsim", "fastsim-sonata"
ENGINE_OF = "prius-nimh"  # whose map is not FASTSim's
# Controllers, the car that gives their engine if not FASTSim, settings, and what a row is called.
Row = tuple[tuple[str, ...], str | None, dict[str, object], str]
ROWS: tuple[Row, ...] = (
    (("rule-based", "mh-qp"), ENGINE_OF, {}, f"{{}}, engine of {ENGINE_OF}"),
    (("mh-qp",), ENGINE_OF, {"mh_qp.learning": True}, f"{{}}, engine of {ENGINE_OF}, learned"),
    (("mh-qp",), None, {"engine.min_on_s": 0}, "{}, engine free to stop"),
)
ROWS_OF: dict[str, tuple[Row, ...]] = {
    PRIUS: (((PRIUS, "rule-based", "ecms", "mh-qp", "dp"), None, {}, "{}"), *ROWS),
    SONATA: (
        ((SONATA, "rule-based", "ecms", "mh-qp", "mh-costate", "dp"), None, {}, "{}"),
        *ROWS,
        (("mh-qp",), None, {"cold_engine.k": 0.0}, "{}, believing in a hot engine"),
    ),
}
DP_GRID = {"dp.grid": "quick"}  # ten times as fast, and off by less than what is at stake here

Rows = list[tuple[str, dict[str, Any]]]


def measured(plant: str, cycles: Sequence[str] = CYCLES) -> Rows:
    """Drive all on a car; return a label and the figures of each run, cycle by cycle."""
    found: Rows = []
    for controllers, engine_of, settings, label in ROWS_OF[plant]:
        chosen = settings | (DP_GRID if "dp" in controllers else {})
        runs = compare(cycles, controllers, engine_of, settings=chosen, plant=plant)
        found += [(label.format(row["controller"]), row) for row in runs.rows()]
    return sorted(found, key=lambda pair: list(cycles).index(pair[1]["cycle"]))


def table(plant: str, rows: Rows) -> str:
    """Return the rows as a Markdown table; with temperatures where there is heat."""
    own = {
        row["cycle"]: row["fuel_soc_balanced_g"] for _, row in rows if row["controller"] == plant
    }
    heated = any(row["plant"]["cabin_min_degc"] is not None for _, row in rows)
    text = "| cycle | controller | balanced g | below FASTSim's own % | SOC | "
    text += "coolant °C | coldest cabin °C | " if heated else ""
    text += "starts | not obeyed s | off trace s |\n|---|---|---:|---:|---:|"
    text += "---:|---:|" * heated + "---:|---:|---:|\n"
    for label, row in rows:
        fuel_g, cycle = row["fuel_soc_balanced_g"], row["cycle"]
        mark = "" if row["comparable"] else "\\*"
        plant_row = row["plant"]
        text += (
            f"| {cycle} | {label} | {fuel_g:.1f}{mark} | {100 * (1 - fuel_g / own[cycle]):.1f} "
            f"| {row['soc_min']:.3f}..{row['soc_max']:.3f} | "
        )
        if heated:
            text += f"{row['t_cl_min_degc']:.0f}..{row['t_cl_max_degc']:.0f} "
            text += f"| {plant_row['cabin_min_degc']:.1f} | "
        text += f"{row['engine_starts']} | {plant_row['seconds_not_obeyed']} "
        text += f"| {plant_row['seconds_off_trace']} |\n"
    return text


def main(arguments: list[str] | None = None) -> int:
    """Write the tables between the marks of a page; see the module."""
    parser = argparse.ArgumentParser(prog="python -m qpmpc.verification.fastsim_table")
    parser.add_argument("page", type=Path, nargs="?", default=Path("docs/fastsim.md"))
    page = parser.parse_args(arguments).page
    for plant in ROWS_OF:
        before, after = around_marks(page, BEGIN.format(plant=plant), END.format(plant=plant))
        write_text(page, f"{before}\n\n{table(plant, measured(plant))}\n{after}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
