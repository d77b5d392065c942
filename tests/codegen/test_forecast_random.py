"""Random trips, previews and seconds: nothing out of bounds, and nothing that a step refuses."""

import shutil
import subprocess

import pytest

from qpmpc.codegen.generate import PRECISIONS, generate
from qpmpc.codegen.values import values_of
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.vehicle import load_vehicle

# Arrays of exactly the size that is declared, so that reading beyond them is noticed; seconds
# before, in and after the trip, in any order. What is filled in a step accepts, or is told of.
RANDOM_C = """
#include <stdio.h>
#include <stdlib.h>
#include "mpc_forecast.h"
static uint64_t word = 1u;
static int32_t below(int32_t limit)
{
    word = word * 6364136223846793005u + 1442695040888963407u;
    return (int32_t)((word >> 33) % (uint64_t)limit);
}
static mpc_road road(int32_t steps)
{
    mpc_real *const demand_w = malloc(sizeof(mpc_real) * (size_t)(steps + (steps == 0)));
    mpc_real *const speed_mps = malloc(sizeof(mpc_real) * (size_t)(steps + (steps == 0)));
    for (int32_t k = 0; k < steps; k++) {
        demand_w[k] = (mpc_real)(below(200001) - 100000);
        speed_mps[k] = (mpc_real)below(89);
    }
    const mpc_road made = {demand_w, speed_mps, steps};
    return made;
}
static void let_go(mpc_road of)
{
    free((void *)of.demand_w);
    free((void *)of.speed_mps);
}
int main(void)
{
    static mpc_state state;
    static mpc_forecast forecast;
    mpc_in in = {0};
    mpc_out out;
    in.soc = (mpc_real)0.6;
    in.t_cl_degc = (mpc_real)50;
    for (int32_t trip = 0; trip < 200; trip++) {
        const mpc_road said = road(below(4) ? below(90) : below(2));
        const int32_t refused = mpc_forecast_start(&forecast, &said);
        if (refused != ((said.steps == 0) ? -1 : 0)) {
            return 1;
        }
        for (int32_t second = 0; second < 8; second++) {
            const mpc_road seen = road(below(60));
            const int32_t step = below(100) - 5;
            const int32_t beyond = below(150) - 5;
            const int32_t bad = below(2) ? mpc_in_from_preview(&forecast, step, beyond, &seen, &in)
                                         : mpc_in_from_forecast(&forecast, step, &in);
            let_go(seen);
            mpc_init(&state);
            const int32_t told = mpc_step(&state, &in, &out) & MPC_BAD_PREVIEW;
            if (told != ((bad != 0) ? MPC_BAD_PREVIEW : 0)) {
                return 2;
            }
        }
        let_go(said);
    }
    printf("done\\n");
    return 0;
}
"""


@pytest.mark.slow
@pytest.mark.parametrize("precision", PRECISIONS)
def test_random_trips_and_seconds_under_sanitizers(tmp_path, precision) -> None:
    if shutil.which("gcc") is None:
        pytest.skip("not installed: gcc")
    few = ControllerSettings().with_settings({"mh_qp.admm.iterations": 2})
    generate(values_of(load_vehicle(), few.mh_qp, few.rule_based), tmp_path, "host", precision)
    (tmp_path / "random.c").write_text(RANDOM_C)
    checks = "address,undefined,float-cast-overflow,float-divide-by-zero"
    flags = f"-std=c99 -O1 -g -fsanitize={checks} -fno-sanitize-recover=all -o random"
    sources = ["random.c", *(p.name for p in tmp_path.glob("mpc_*.c"))]
    for command in (["gcc", *flags.split(), *sources, "-lm"], ["./random"]):
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    assert done.stdout == "done\n"
