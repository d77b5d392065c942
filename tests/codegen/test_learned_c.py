"""Learning in C keeps its digits, in single precision too: long driving at one power."""

import shutil
import subprocess

import pytest

from qpmpc.codegen.generate import PRECISIONS, generate
from qpmpc.codegen.values import values_of
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.vehicle import load_vehicle

SETTINGS = ControllerSettings().with_settings({"mh_qp.learning": True})
# An hour and a half at one power, in which 0.95 of the map's fuel is measured.
PROGRAM = """
#include <stdio.h>
#include "mpc_learned.h"
#include "mpc_parts.h"
static mpc_state state;
int main(void) {
    const mpc_real p_eng_w = (mpc_real)20000;
    const mpc_real map_g = mpc_map_cold_factor((mpc_real)85) * mpc_map_fuel_g_per_s(p_eng_w);
    mpc_init(&state);
    for (int k = 0; k < 5400; k++) {
        state.watch.good.engine_on = 1;
        state.watch.good.engine_for_s = k + 2;
        state.watch.good.t_cl_degc = (mpc_real)85;
        state.watch.good.p_eng_before_w = p_eng_w;
        state.watch.good.fuel_g = (mpc_real)0.95 * map_g;
        mpc_learned_take(&state);
    }
    mpc_learned_curve(&state);
    int k = 0;
    while (mpc_par.learned_power_w[k + 1] < p_eng_w) { k++; }
    const mpc_real learned = state.learned.intercept[k] + state.learned.slope[k] * p_eng_w;
    printf("%.9g", (double)(learned / mpc_map_fuel_g_per_s(p_eng_w)));
    return mpc_learned_check(&state) ? 0 : 1;
}
"""


@pytest.mark.skipif(shutil.which("cc") is None, reason="not installed: cc")
@pytest.mark.parametrize("precision", PRECISIONS)
def test_an_hour_at_one_power_teaches_the_fuel_measured_there(precision, tmp_path) -> None:
    """The map counts as little beside it; the learned curve is a chord, up to 1 % above."""
    generate(
        values_of(load_vehicle(), SETTINGS.mh_qp, SETTINGS.rule_based), tmp_path, "host", precision
    )
    (tmp_path / "steady.c").write_text(PROGRAM)
    sources = ["steady.c", *(file.name for file in tmp_path.glob("mpc*.c"))]
    command = ["cc", "-std=c99", "-O2", "-ffp-contract=off", *sources, "-lm", "-o", "steady"]
    subprocess.run(command, cwd=tmp_path, check=True)
    ran = subprocess.run(["./steady"], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert float(ran.stdout) == pytest.approx(0.955, abs=0.01)
