/* A second gets no more power than leaves room in the battery for the braking to come.
 *
 * The same in Python, with the reason: qpmpc/controllers/full_battery.py.
 */
#include "mpc_constants.h"
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"

mpc_real mpc_full_battery_w(const mpc_state *state, const mpc_prices *prices)
{
    const mpc_real net_w = state->stage[0].road.net_w;
    const mpc_real soc_max = state->cal.soc_max;
    mpc_real stored_j = REAL(0.0);
    mpc_real gained_j = REAL(0.0);
    for (int32_t k = 1; k < MPC_SHORT; k++) {
        const mpc_stage_road *const road = &state->stage[k].road;
        stored_j -= road->duration_s * road->internal_off_w;
        gained_j = real_max(gained_j, stored_j + road->rise_j);
    }
    const mpc_real empty_soc = state->cal.soc_min + SOC_MARGIN;
    const mpc_real full_soc = real_max(soc_max - (gained_j / mpc_map_energy_j(soc_max)), empty_soc);
    const mpc_real room_w = net_w - mpc_map_power_to_reach_w(state->watch.good.soc, full_soc);
    const mpc_real least_w =
        real_max(mpc_par.engine_min_w, net_w - mpc_par.battery_discharge_max_w);
    const mpc_real counts = above(gained_j, REAL(0.0)) * not_below(prices->fuel, FUEL_LEAST);
    const mpc_real is_seen = (mpc_par.polish != 0) ? counts : REAL(0.0);
    return real_max(blend(is_seen, room_w, mpc_par.engine_max_w), least_w);
}
