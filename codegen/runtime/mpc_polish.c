/* A second minimised at the plan's prices of SOC and coolant (mpc_priced.h), on the engine's line.
 *
 * The same in Python, with the derivation: qpmpc/qp/polish.py.
 */
#include "mpc_constants.h"
#include "mpc_learned.h"
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_priced.h"
#include "mpc_real.h"

/* The engine's line, or the curve learned. */
#if MPC_LEARNING
#define LINE_SLOPE(i) FUEL_SLOPE(i)
#define LINE_INTERCEPT(i) FUEL_INTERCEPT(i)
#define LINE_SCALE REAL(1.0)
#else
#define LINE_SLOPE(i) (mpc_par.line_slope[i])
#define LINE_INTERCEPT(i) (mpc_par.line_intercept[i])
#define LINE_SCALE (state->cal.fuel_scale)
#endif

/* A least-cost power, with the fuel and the battery's internal power there. */
typedef struct {
    mpc_real power_w;
    mpc_real fuel_g_per_s;
    mpc_real internal_w;
} least_drive;

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

/* Power of least cost on a piece of the line, of this slope, between these. */
static mpc_real power_on(const stage_prices *price, mpc_real net_w, int32_t piece, mpc_real slope,
                         mpc_real low_w, mpc_real high_w)
{
    const mpc_real own_w = stationary_w(net_w, ratio_at(price, slope));
    return real_min(real_max(own_w, real_max(mpc_par.line_begin_w[piece], low_w)),
                    real_min(mpc_par.line_end_w[piece], high_w));
}

/* Of all pieces of the line, which need not be convex, that of least cost; at planned_w if a charge
 * has no price. */
static least_drive least_of(const mpc_state *state, const mpc_prices *paid, int32_t k,
                            mpc_real planned_w)
{
    const mpc_real net_w = state->stage[k].road.net_w;
    const int32_t is_priced = ((paid->internal > REAL(0.0)) && (mpc_par.polish != 0)) ? 1 : 0;
    const mpc_real internal = pick(is_priced, paid->internal, REAL(1.0));
    const stage_prices price = prices_at(internal, LINE_SCALE * paid->fuel, paid->p_eng);
    const mpc_real least_w =
        real_max(mpc_par.engine_min_w, net_w - mpc_par.battery_discharge_max_w);
    const mpc_real most_w =
        real_max(real_min(mpc_par.engine_max_w, net_w + mpc_par.battery_charge_max_w), least_w);
    const mpc_real low_w = pick(is_priced, least_w, planned_w);
    const mpc_real high_w = pick(is_priced, most_w, planned_w);
    mpc_real least_g = NEVER_G;
    int32_t best = 0;
    for (int32_t i = 0; i < MPC_LINE_PIECES; i++) {
        const mpc_real power_w = power_on(&price, net_w, i, LINE_SLOPE(i), low_w, high_w);
        const mpc_real burnt = (LINE_SLOPE(i) * power_w) + LINE_INTERCEPT(i);
        const mpc_real inside_g = (price.fuel * burnt) + (price.power * power_w)
                                  + (price.internal * internal_w(net_w - power_w));
        /* without a branch, so that every second takes the same instructions */
        const mpc_real outside_w = real_max(real_max(mpc_par.line_begin_w[i], low_w)
                                                - real_min(mpc_par.line_end_w[i], high_w),
                                            REAL(0.0));
        const mpc_real cost_g = inside_g + (NEVER_G * outside_w);
        best = (cost_g < least_g) ? i : best;
        least_g = real_min(least_g, cost_g);
    }
    const mpc_real power_w = power_on(&price, net_w, best, LINE_SLOPE(best), low_w, high_w);
    const mpc_real burnt = (LINE_SLOPE(best) * power_w) + LINE_INTERCEPT(best);
    const least_drive least = {power_w, LINE_SCALE * burnt, internal_w(net_w - power_w)};
    return least;
}

mpc_real mpc_polish_power_w(const mpc_state *state, const mpc_prices *prices, int32_t k,
                            mpc_real planned_w)
{
    return least_of(state, prices, k, planned_w).power_w;
}

#if MPC_STARTS
mpc_going mpc_polish_going(const mpc_state *state, const mpc_prices *prices, int32_t k)
{
    const least_drive on = least_of(state, prices, k, REAL(0.0));
    const mpc_real gain_w = state->stage[k].road.internal_off_w - on.internal_w;
    const mpc_real spent = (prices->fuel * on.fuel_g_per_s) + (prices->p_eng * on.power_w);
    const mpc_going going = {on.power_w, gain_w, spent - (prices->internal * gain_w)};
    return going;
}
#endif
