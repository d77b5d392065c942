/* A second that the battery cannot drive without falling below its lower limit, or in which the ramp
 * asks for power, gets what costs least at the plan's prices, not the little that is lacking.
 *
 * The same in Python, with the reason: qpmpc/controllers/empty_battery.py.
 */
#include "mpc_constants.h"
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"

mpc_real mpc_empty_battery_w(const mpc_state *state, mpc_real power_w, mpc_real ramp_w)
{
    const mpc_real reach_w =
        mpc_map_power_to_reach_w(state->watch.good.soc, state->cal.soc_min + SOC_MARGIN);
    const int32_t is_needed = ((state->stage[0].road.net_w > reach_w) || (ramp_w > REAL(0.0))) ? 1
                                                                                               : 0;
    return (is_needed != 0) ? real_max(power_w, ramp_w) : REAL(0.0);
}
