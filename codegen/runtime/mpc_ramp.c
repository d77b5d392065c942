/* Least engine power of the coming second, after which the ramp leads in good time to what the
 * battery cannot give.
 *
 * The same in Python, with the formula: qpmpc/controllers/ramp.py.
 */
#include "mpc_constants.h"
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"

mpc_real mpc_ramp_least_w(const mpc_state *state)
{
    const mpc_calibration *const cal = &state->cal;
    const mpc_real soc = state->watch.good.soc;
    const mpc_real to_spare = real_max(soc - (cal->soc_min + SOC_KEPT), REAL(0.0));
    mpc_real total_w = state->stage[0].road.net_w;
    mpc_real least_w = REAL(0.0);
    for (int32_t k = 1; k < MPC_SHORT; k++) {
        const mpc_stage_road *const road = &state->stage[k].road;
        const mpc_real seconds = (mpc_real)k + REAL(1.0);
        const mpc_real risen_w = (cal->ramp_w_per_s - POWER_MARGIN_W) * (mpc_real)k;
        total_w += road->net_w;
        const mpc_real gives_w = mpc_map_power_to_reach_w(soc, soc - (to_spare / seconds));
        const mpc_real gives_most_w = mpc_par.battery_discharge_max_w - POWER_MARGIN_W;
        const mpc_real at_once_w = (road->net_w - gives_most_w) - risen_w;
        const mpc_real in_all_w = ((total_w / seconds) - gives_w) - (REAL(0.5) * risen_w);
        const mpc_real needed_w = real_max(at_once_w, in_all_w);
        least_w = real_max(least_w, above(road->duration_s, REAL(0.0)) * needed_w);
    }
    return real_min(least_w, mpc_par.engine_max_w);
}
