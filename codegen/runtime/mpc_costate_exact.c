/* The least of a second with its engine on, at given prices, with f itself, as in mpc_costate_stage.c:
 * f by its chords, of any shape, so that all pieces are compared. The same in Python: qpmpc/pwa/priced.py.
 */
#include "mpc_constants.h"
#include "mpc_costate_parts.h"
#include "mpc_model.h"
#include "mpc_priced.h"
#include "mpc_real.h"

void mpc_costate_minimise_exactly(mpc_stage *stage, int32_t which)
{
    mpc_costate_dual *const dual = &stage->dual[which];
    const mpc_costate_part *const part = &stage->p.part[MPC_FREE];
    mpc_drive *const on = &dual->drive[MPC_FREE];
    const mpc_stage_program *const of = &stage->p.of;
    const stage_prices price = prices_at(dual->charge * of->charge_per_w,
                                         of->fuel_cost - (dual->nu * of->per_fuel),
                                         dual->nu * of->per_power);
    const mpc_real net_w = part->net_w;
    mpc_real least_g = NEVER_G;
    for (int32_t i = 0; i < MPC_LINE_PIECES; i++) {
        const mpc_real slope = mpc_par.line_slope[i];
        const mpc_real begin = real_max(mpc_par.line_begin_w[i], part->low_w);
        const mpc_real end = real_min(mpc_par.line_end_w[i], part->high_w);
        const mpc_real ratio = ratio_at(&price, slope);
        const mpc_real power_w = real_min(real_max(stationary_w(net_w, ratio), begin), end);
        const mpc_real fuel = (slope * power_w) + mpc_par.line_intercept[i];
        const mpc_real internal = internal_w(net_w - power_w);
        const mpc_real cost = (price.fuel * fuel) + (price.power * power_w)
                              + (price.internal * internal);
        const int32_t is_better = ((begin <= end) ? 1 : 0) & ((cost < least_g) ? 1 : 0);
        on->power_w = pick(is_better, power_w, on->power_w);
        on->fuel_g_per_s = pick(is_better, fuel, on->fuel_g_per_s);
        on->internal_w = pick(is_better, internal, on->internal_w);
        least_g = pick(is_better, cost, least_g);
    }
    dual->on_g[MPC_FREE] = least_g;
}
