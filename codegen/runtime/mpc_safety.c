/* Safety layer: makes any one-second command admissible, in closed form.
 *
 * Whatever the optimiser returned, the result is finite and in range. In order of rank, the last
 * word first: power limits of battery and engine; SOC limits; coolant limits.
 */
#include "mpc_constants.h"
#include "mpc_heat.h"
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"

/* Largest engine power whose heat into the coolant is at most heat_w. */
static real_t power_for_heat_w(real_t heat_w, real_t t_cl_degc)
{
    const real_t factor = map_cold_factor(t_cl_degc) * mpc_par.lhv_j_per_g;
    const real_t share = REAL(1.0) - mpc_par.exhaust_share;
    real_t low = REAL(0.0);
    real_t high = mpc_par.engine_max_w;
    for (int32_t i = 0; i < BISECTIONS; i++) {
        const real_t middle = REAL(0.5) * (low + high);
        const real_t heat = share * ((factor * map_fuel_g_per_s(middle)) - middle);
        const int32_t cool = (heat <= heat_w) ? 1 : 0;
        low = (cool != 0) ? middle : low;
        high = (cool != 0) ? high : middle;
    }
    return low;
}

/* Engine power that just warms the coolant to its upper limit within the second. */
static real_t cooling_limit_w(const mpc_measured *seen)
{
    const real_t room_k = mpc_par.t_cl_max_degc - T_CL_MARGIN_K - seen->t_cl_degc;
    const real_t out_w = heat_cooling_w(seen->t_cl_degc, seen->speed_mps);
    /* always computed, so that every step takes the same time */
    const real_t limit_w =
        power_for_heat_w(out_w + (room_k * mpc_par.heat_capacity_j_per_k), seen->t_cl_degc);
    return (room_k > T_CL_NEAR_K) ? mpc_par.engine_max_w : limit_w;
}

mpc_command safety_admissible(mpc_command wish, const mpc_measured *seen)
{
    const real_t net_w = seen->demand_w + mpc_par.aux_power_w;
    const real_t give_w = map_discharge_limit_w(seen->soc - SOC_MARGIN);
    /* below `low` the battery gives too much, above `high` it takes too much */
    const real_t low = real_max(net_w - give_w, REAL(0.0));
    const real_t high = real_min(net_w + map_charge_limit_w(seen->soc), mpc_par.engine_max_w);
    const real_t coolest_w = cooling_limit_w(seen);
    int32_t on = wish.engine_on;
    real_t p_eng_w = (wish.p_eng_w >= REAL(0.0)) ? wish.p_eng_w : REAL(0.0); /* not NaN either */
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
        command.p_eng_w =
            real_min(real_max(real_max(p_eng_w, low), mpc_par.engine_min_w), high);
    }
    return command;
}
