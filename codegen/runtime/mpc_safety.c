/* Safety layer: makes any one-second command admissible, in closed form.
 *
 * Whatever the optimiser returned, the result is finite and in range. In order of priority: power
 * limits of battery and engine; SOC limits; coolant limits.
 */
#include "mpc_constants.h"
#include "mpc_heat.h"
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"

/* Largest engine power whose heat into the coolant is at most heat_w. */
static mpc_real power_for_heat_w(mpc_real heat_w, mpc_real t_cl_degc)
{
    const mpc_real factor = mpc_map_cold_factor(t_cl_degc) * mpc_par.lhv_j_per_g;
    const mpc_real share = REAL(1.0) - mpc_par.exhaust_share;
    mpc_real low = REAL(0.0);
    mpc_real high = mpc_par.engine_max_w;
    for (int32_t i = 0; i < BISECTIONS; i++) {
        const mpc_real middle = REAL(0.5) * (low + high);
        const mpc_real heat = share * ((factor * mpc_map_fuel_g_per_s(middle)) - middle);
        const int32_t cool = (heat <= heat_w) ? 1 : 0;
        low = (cool != 0) ? middle : low;
        high = (cool != 0) ? high : middle;
    }
    return low;
}

/* Engine power that just warms the coolant to its upper limit within the second. */
static mpc_real cooling_limit_w(const mpc_measured *seen)
{
    const mpc_real room_k = mpc_par.t_cl_max_degc - T_CL_MARGIN_K - seen->t_cl_degc;
    const mpc_real out_w = heat_cooling_w(seen->t_cl_degc, seen->speed_mps);
    /* always computed, so that every step takes the same time */
    const mpc_real limit_w =
        power_for_heat_w(out_w + (room_k * mpc_par.heat_capacity_j_per_k), seen->t_cl_degc);
    return (room_k > T_CL_NEAR_K) ? mpc_par.engine_max_w : limit_w;
}

mpc_command mpc_safety_admissible(mpc_command wish, const mpc_measured *seen)
{
    const mpc_real net_w = seen->demand_w + mpc_par.aux_power_w;
    const mpc_real give_w = mpc_map_discharge_limit_w(seen->soc - SOC_MARGIN);
    /* below `low` the battery gives too much, above `high` it takes too much */
    const mpc_real low = real_max(net_w - give_w, REAL(0.0));
    const mpc_real high = real_min(net_w + mpc_map_charge_limit_w(seen->soc), mpc_par.engine_max_w);
    const mpc_real coolest_w = cooling_limit_w(seen);
    int32_t on = wish.engine_on;
    mpc_real p_eng_w = (wish.p_eng_w >= REAL(0.0)) ? wish.p_eng_w : REAL(0.0); /* not NaN either */
    if ((on == 0) && (seen->t_cl_degc < (mpc_par.t_cl_min_degc + T_CL_COOLING_K))) {
        on = 1;
        p_eng_w = mpc_par.rule_heat_power_w;
    }
    if (on != 0) {
        p_eng_w = real_min(p_eng_w, coolest_w);
    }
    if (low > REAL(0.0)) {
        on = 1;
    }
    mpc_command command = {REAL(0.0), 0};
    /* braking at the charge limit leaves no room for the engine: it must be off */
    if ((on != 0) && (high >= mpc_par.engine_min_w)) {
        command.engine_on = 1;
        command.p_eng_w = real_min(real_max(real_max(p_eng_w, low), mpc_par.engine_min_w), high);
    }
    return command;
}
