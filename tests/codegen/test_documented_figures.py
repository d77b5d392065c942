"""What docs/embedded.md and docs/timing.md say of instructions and memory is what is measured.

To within 3 %: other versions of the compiler give other code. Fuel is not measured again here; the
tests of the host library and of the target hold it against Python's.
"""

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from qpmpc.codegen.firmware import missing_tools
from qpmpc.codegen.generate import ALGORITHMS, PRECISIONS, Algorithm, Precision
from qpmpc.codegen.pil.loop import CLOCKS_MHZ, CYCLES_AN_INSTRUCTION, processor_in_the_loop
from qpmpc.codegen.pil.pareto import ITERATIONS
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle, load_cycle
from qpmpc.trip import Trip

MISSING = missing_tools()
pytestmark = pytest.mark.skipif(bool(MISSING), reason=f"not installed: {', '.join(MISSING)}")

DOCS = Path(__file__).parents[2] / "docs"
EMBEDDED, TIMING = ((DOCS / name).read_text("utf-8") for name in ("embedded.md", "timing.md"))
TOLERANCE = 0.03
STEPS = 6  # every step takes the same instructions


def rows_of(text: str, columns: int) -> list[list[str]]:
    """Cells of every table row of that many columns, without headings."""
    rows = [line.strip("|").split("|") for line in text.splitlines() if line.startswith("|")]
    cells = [[cell.strip().replace(",", "") for cell in row] for row in rows]
    return [row for row in cells if len(row) == columns and any(c.isdigit() for c in row[-1])]


@cache
def measured(
    algorithm: Algorithm,
    precision: Precision,
    iterations: int,
    blocks: int = 0,
    prepared: bool = False,
) -> dict[str, float]:
    """Instructions per step, flash and RAM of a few steps."""
    overrides: dict[str, object] = {
        "mh_qp.admm.iterations": iterations,
        "mh_qp.prepared": prepared,
    }
    if blocks:
        overrides["mh_qp.horizon.blocks"] = blocks
    whole = load_cycle("nycc")
    trip = Cycle.from_samples("start", whole.time_s[: STEPS + 1], whole.speed_mps[: STEPS + 1])
    settings = ControllerSettings().with_settings(overrides)
    result = processor_in_the_loop(Trip(trip), settings, precision, algorithm=algorithm)
    return {
        "instructions": float(np.median(result.instructions)),
        "flash": float(result.footprint.flash),
        "ram": float(result.ram_bytes),
        "state": float(result.state_bytes),
    }


def table() -> dict[tuple[str, str, int], list[float]]:
    """Instructions, flash and RAM of the table of docs/embedded.md, by algorithm, precision, K."""
    found = {}
    for row in rows_of(EMBEDDED, 8):
        if row[0] in ALGORITHMS:
            key = row[0], row[1], int(row[2].split()[0])
            found[key] = [float(row[i]) for i in (3, 5, 6)]
    return found


def test_the_table_has_every_combination() -> None:
    expected = {(s, p, k) for s in ALGORITHMS for p in PRECISIONS for k in ITERATIONS}
    assert set(table()) == expected


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("precision", PRECISIONS)
def test_instructions_flash_and_ram_are_as_documented(algorithm, precision) -> None:
    """Least and most iterations are measured; between them instructions grow by the same."""
    least, most = (measured(algorithm, precision, k) for k in (ITERATIONS[0], ITERATIONS[-1]))
    growth = (most["instructions"] - least["instructions"]) / (ITERATIONS[-1] - ITERATIONS[0])
    for k in ITERATIONS:
        instructions, flash, ram = table()[algorithm, precision, k]
        expected = least["instructions"] + growth * (k - ITERATIONS[0])
        assert instructions == pytest.approx(expected, rel=TOLERANCE)
        assert flash == pytest.approx(least["flash"], rel=TOLERANCE)
        assert ram == pytest.approx(least["ram"], rel=TOLERANCE)


def test_size_of_one_controller_is_as_documented() -> None:
    text = re.search(r"one controller: ([\d,]+) B in f32, ([\d,]+) B in f64", EMBEDDED)
    assert text
    for stated, precision in zip(text.groups(), PRECISIONS, strict=True):
        size = measured("admm", precision, ITERATIONS[0])["state"]
        assert float(stated.replace(",", "")) == pytest.approx(size, rel=TOLERANCE)


def test_estimated_milliseconds_follow_from_the_instructions() -> None:
    """To the tenth that is printed."""
    counts = table()["admm", "f32", 30][0]
    stated = {int(row[0].split()[0]): row[1:] for row in rows_of(EMBEDDED, 4) if "MHz" in row[0]}
    assert tuple(stated) == CLOCKS_MHZ
    for clock, cells in stated.items():
        for cell, per_instruction in zip(cells, CYCLES_AN_INSTRUCTION, strict=True):
            milliseconds = counts * per_instruction / clock * 1e-3
            assert float(cell) == pytest.approx(milliseconds, abs=0.06)


def test_instructions_over_the_horizon_are_as_documented() -> None:
    """docs/timing.md: a fixed part, a part per stage, a part per stage and iteration."""
    found = re.search(r"instructions = ([\d,]+) \+ n \(([\d,]+) \+ ([\d,.]+) K\)", TIMING)
    assert found
    fixed, per_stage, per_iteration = (float(x.replace(",", "")) for x in found.groups())
    rows = [[int(float(c)) for c in row[:4]] for row in rows_of(TIMING, 5)]
    assert len(rows) >= 5
    for k, _, stages, instructions in rows:
        formula = fixed + stages * (per_stage + per_iteration * k)
        assert instructions == pytest.approx(formula, rel=0.005)
    k, blocks, _, instructions = min(rows, key=lambda row: row[1])
    now = measured("admm", "f32", k, blocks, prepared=True)["instructions"]
    assert instructions == pytest.approx(now, rel=TOLERANCE)
