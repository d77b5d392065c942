"""Statistics of the long horizon on the Cortex-M7 in QEMU: what they cost, and the same numbers."""

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from qpmpc.codegen.controller import InputBuilder
from qpmpc.codegen.firmware import (
    ICOUNT_SHIFT,
    INSTRUCTIONS_A_TICK,
    QEMU,
    make_firmware,
    missing_tools,
)
from qpmpc.codegen.generate import generate
from qpmpc.codegen.host_library import structures
from qpmpc.codegen.values import values_of
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import load_cycle
from qpmpc.preview import StageBuilder, Trace
from qpmpc.trip import Observation
from qpmpc.vehicle import load_vehicle

MISSING = missing_tools()
pytestmark = pytest.mark.skipif(bool(MISSING), reason=f"not installed: {', '.join(MISSING)}")

CAR = load_vehicle()
HORIZON = ControllerSettings().mh_qp.horizon
EMBEDDED = (Path(__file__).parents[2] / "docs" / "embedded.md").read_text("utf-8")

# The trip lies in flash. Written for each second: ticks, then mpc_in; first those of the start.
MAIN_C = """
#include "board.h"
#include "mpc_forecast.h"
static const mpc_real demand_w[] = {@DEMAND@};
static const mpc_real speed_mps[] = {@SPEED@};
static mpc_forecast forecast;
static mpc_in in;
static uint32_t ticks;
int main(void)
{
    static const char name[] = "answer";
    const int32_t file = board_open_write(name, sizeof(name) - 1u);
    const mpc_road trip = {demand_w, speed_mps, (int32_t)(sizeof(demand_w) / sizeof(mpc_real))};
    board_start_timer();
    uint32_t start = board_ticks();
    int32_t result = mpc_forecast_start(&forecast, &trip);
    ticks = board_ticks() - start;
    result |= board_write(file, &ticks, sizeof(ticks));
    for (int32_t step = 0; (step < trip.steps) && (result == 0); step++) {
        start = board_ticks();
        result = mpc_in_from_forecast(&forecast, step, &in);
        ticks = board_ticks() - start;
        result |= board_write(file, &ticks, sizeof(ticks));
        result |= board_write(file, &in, sizeof(in));
    }
    return (result == 0) ? 0 : 1;
}
"""


def on_target(trip: Trace, folder: Path) -> tuple[float, np.ndarray, list[object]]:
    """Instructions of the start, those of each second, and each second's input."""
    settings = ControllerSettings()
    values = values_of(CAR, settings.mh_qp, settings.rule_based)
    generate(values, folder, "cortex-m7", "f32")
    text = MAIN_C
    for place, array in (("@DEMAND@", trip.demand_w), ("@SPEED@", trip.speed_mps)):
        text = text.replace(place, ", ".join(f"{float(x)!r}f" for x in array))
    (folder / "main.c").write_text(text)
    elf = make_firmware(folder)
    machine = "-M mps2-an500 -nographic -monitor none -serial none"
    semihosting = "-semihosting-config enable=on,target=native"
    count = f"-icount shift={ICOUNT_SHIFT},sleep=off"
    command = [QEMU, *f"{machine} {semihosting} {count} -kernel {elf}".split()]
    subprocess.run(command, cwd=folder, stdin=subprocess.DEVNULL, check=True, timeout=300)
    kind, _ = structures("f32", values.sizes.short_stages, values.sizes.long_stages, False)
    record = np.dtype([("ticks", "<u4"), ("in", kind)])
    data = (folder / "answer").read_bytes()
    records = np.frombuffer(data[4:], dtype=record)
    assert len(records) == trip.steps
    first = int(np.frombuffer(data[:4], dtype="<u4")[0])
    each = records["ticks"] * INSTRUCTIONS_A_TICK
    return first * INSTRUCTIONS_A_TICK, each, list(records["in"])


@pytest.mark.slow
def test_cost_on_the_target_is_as_documented_and_does_not_grow_with_the_trip(tmp_path) -> None:
    stated = r"at most ([\d,]+) instructions per second.*?([\d,]+) per second of the\s+trip at"
    found = re.search(stated, EMBEDDED, re.DOTALL)
    assert found
    a_step, a_start = (float(x.replace(",", "")) for x in found.groups())
    wltc = Trace.of(load_cycle("wltc-3b"), CAR)
    single = Trace(*(x.astype(np.float32) for x in (wltc.demand_w, wltc.speed_mps)))
    long = Trace(np.tile(single.demand_w, 4), np.tile(single.speed_mps, 4))
    start, steps, inputs = on_target(single, tmp_path / "wltc")
    _, long_steps, _ = on_target(long, tmp_path / "two-hours")
    assert long_steps.max() <= 1.02 * steps.max()
    assert steps.max() == pytest.approx(a_step, rel=0.03)
    assert start / wltc.steps == pytest.approx(a_start, rel=0.03)
    double = Trace(*(x.astype(float) for x in (single.demand_w, single.speed_mps)))
    python = InputBuilder(StageBuilder(CAR, double, double, HORIZON).preview)
    want, _ = structures("f64", HORIZON.short_stages, HORIZON.classes * HORIZON.blocks, False)
    want = want()
    for step, have in enumerate(inputs):
        python.fill(Observation(step, 0.6, 50.0, False, 0.0, 0.0), want)
        assert list(have["long_duration_s"]) == list(want.long_duration_s)
        assert list(have["long_rises"]) == list(want.long_rises)
        assert have["short_count"] == want.short_count
        powers = ("net_w", "internal_off_w", "free_net_w", "free_internal_off_w")
        of = dict.fromkeys(powers, 0.01) | {"speed_mps": 1e-5, "must_share": 1e-6}
        for name, absolute in of.items():
            np.testing.assert_allclose(
                have[f"long_{name}"], getattr(want, f"long_{name}"), rtol=0.0, atol=absolute
            )
        for name in ("long_fall_j", "long_rise_j", "short_rise_j"):
            np.testing.assert_allclose(have[name], getattr(want, name), rtol=1e-5, atol=1.0)
