/* The coming second beside the plan: what it gets at least, by the rules together.
 *
 * The same in Python: qpmpc/controllers/coming_second.py.
 */
#include "mpc_parts.h"
#include "mpc_real.h"

mpc_real mpc_coming_least_w(const mpc_state *state, const mpc_prices *prices,
                            const mpc_real *on_share, const mpc_going *second, mpc_real room_w)
{
    const mpc_real power_w = second[0].power_w;
    const mpc_real ramp_w = mpc_ramp_least_w(state);
    const mpc_real fitting_w = real_min(power_w, room_w);
    mpc_real least_w = real_max(ramp_w, mpc_empty_battery_w(state, fitting_w, ramp_w));
#if MPC_STARTS
    least_w = real_max(least_w, mpc_last_run_w(state, prices, &second[0]));
    least_w = real_max(least_w, mpc_last_start_w(state, prices, second));
    least_w = real_max(least_w, mpc_short_run_w(state, prices, on_share, second));
    least_w = real_max(least_w, mpc_battery_run_w(state, on_share, second));
#endif
    const int32_t is_planned = (on_share[0] >= state->cal.on_threshold) ? 1 : 0;
    return real_max(least_w, mpc_heating_run_w(state, prices, power_w, is_planned));
}
