/* A second minimised at the plan's prices of SOC and coolant, on the battery's own curve:
 *
 *     min_E  w_F f(E) + w_E E + w_G l(P0 - E)
 *
 * The same in Python, with the derivation: qpmpc/qp/polish.py.
 */
#include "mpc_constants.h"
#include "mpc_learned.h"
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"

/* Price of a variable by a row: dual times entry, in SI units. */
static mpc_real by_row(const mpc_stage *stage, int32_t row, int32_t variable, mpc_real entry)
{
    return (stage->y[row] * entry) / (stage->row[row] * stage->column[variable]);
}

mpc_prices mpc_polish_prices(const mpc_state *state)
{
    const mpc_stage *const stage = &state->stage[0];
    const mpc_real own = stage->q[MPC_VAR_FUEL] / (stage->column[MPC_VAR_FUEL] * state->cost);
    const mpc_prices prices = {own + by_row(stage, MPC_ROW_T_CL, MPC_VAR_FUEL, stage->a.t_cl.fuel),
                               by_row(stage, MPC_ROW_T_CL, MPC_VAR_P_ENG, stage->a.t_cl.p_eng),
                               by_row(stage, MPC_ROW_SOC, MPC_VAR_INTERNAL, stage->a.soc.internal)};
    return prices;
}

mpc_real mpc_polish_power_w(const mpc_state *state, const mpc_prices *prices, int32_t k,
                            mpc_real planned_w)
{
    const mpc_real net_w = state->stage[k].road.net_w;
    const int32_t is_priced = ((prices->internal > REAL(0.0)) && (mpc_par.polish != 0)) ? 1 : 0;
    const mpc_real divisor = (is_priced != 0) ? prices->internal : REAL(1.0);
    const mpc_real quarter = (mpc_par.plan_voltage_v * mpc_par.plan_voltage_v) / REAL(4.0);
    mpc_real best_w = mpc_par.engine_max_w;
    for (int32_t i = 0; i < MPC_FUEL_PIECES; i++) {
        const mpc_real priced = ((prices->fuel * FUEL_SLOPE(i)) + prices->p_eng) / divisor;
        const mpc_real ratio = real_max(priced, LEAST_RATIO);
        const mpc_real resistance = (ratio > REAL(1.0)) ? mpc_par.plan_resistance_discharge_ohm
                                                        : mpc_par.plan_resistance_charge_ohm;
        const mpc_real battery_w = (quarter / resistance)
                                   * (REAL(1.0) - (REAL(1.0) / (ratio * ratio)));
        best_w = real_min(best_w, real_max(net_w - battery_w, mpc_par.fuel_begin_w[i]));
    }
    const mpc_real low_w = real_max(mpc_par.engine_min_w, net_w - mpc_par.battery_discharge_max_w);
    const mpc_real high_w =
        real_max(real_min(mpc_par.engine_max_w, net_w + mpc_par.battery_charge_max_w), low_w);
    return (is_priced != 0) ? real_clip(best_w, low_w, high_w) : planned_w;
}

#if MPC_STARTS
mpc_going mpc_polish_going(const mpc_state *state, const mpc_prices *prices, int32_t k)
{
    const mpc_stage_road *const road = &state->stage[k].road;
    const mpc_real power_w = mpc_polish_power_w(state, prices, k, REAL(0.0));
    const mpc_real gain_w = road->internal_off_w
                            - mpc_map_planned_internal_w(road->net_w - power_w);
    const mpc_real spent = (prices->fuel * mpc_qp_least_fuel(state, power_w, REAL(1.0)))
                           + (prices->p_eng * power_w);
    const mpc_going going = {power_w, gain_w, spent - (prices->internal * gain_w)};
    return going;
}
#endif
