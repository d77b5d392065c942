/* The least of one stage with its engine on, at given prices, in closed form:
 *
 *     min_E  w_F f(E) + w_E E + w_G l(P0 - E)   between the limits of E
 *
 * On a piece of f of slope a the slope of l has to be r = (w_F a + w_E) / w_G, at the battery power
 * U^2 (1 - 1 / r^2) / (4 R). The same in Python: qpmpc/costate/stage.py.
 */
#include "mpc_constants.h"
#include "mpc_costate_parts.h"
#include "mpc_model.h"
#include "mpc_real.h"

#define NEVER_G REAL(1.0e30)
#define MOST_GIVEN REAL(1.0e30) /* finite where the price is nil */

mpc_prices mpc_costate_prices(const mpc_stage *stage, const mpc_costate_dual *dual)
{
    const mpc_stage_program *const of = &stage->p.of;
    const mpc_prices price = {of->fuel_cost - (dual->nu * of->per_fuel), dual->nu * of->per_power,
                              dual->charge * of->charge_per_w};
    return price;
}

/* U^2 / (4 R) of the battery */
static inline mpc_real quarter_w(int32_t discharges)
{
    return pick(discharges, mpc_par.quarter_discharge_w, mpc_par.quarter_charge_w);
}

/* l(P); beyond the most that the battery can give the current stays. */
static inline mpc_real internal_w(mpc_real power_w)
{
    const int32_t discharges = (power_w > REAL(0.0)) ? 1 : 0;
    const mpc_real inverse =
        pick(discharges, mpc_par.per_quarter_discharge_w, mpc_par.per_quarter_charge_w);
    const mpc_real under = REAL(1.0) - (power_w * inverse);
    const mpc_real root = REAL_SQRT(real_max(under, REAL(0.0)));
    return (REAL(2.0) * real_min(power_w, quarter_w(discharges))) / (REAL(1.0) + root);
}

/* r of a piece, and E there */
typedef struct {
    mpc_real ratio;
    mpc_real power_w;
} stationary;

static inline stationary stationary_at(mpc_real net_w, const mpc_prices *price, mpc_real per,
                                       mpc_real slope)
{
    const mpc_real priced = ((price->fuel * slope) + price->power) * per;
    const mpc_real ratio = real_max(priced, LEAST_RATIO);
    const mpc_real inverse = REAL(1.0) / ratio;
    const mpc_real quarter = quarter_w((ratio > REAL(1.0)) ? 1 : 0);
    const stationary found = {ratio, net_w - (quarter * (REAL(1.0) - (inverse * inverse)))};
    return found;
}

/* dE of a unit of marginal cost */
static mpc_real given_by(mpc_real ratio, mpc_real w_internal)
{
    const mpc_real quarter = quarter_w((ratio > REAL(1.0)) ? 1 : 0);
    return (REAL(2.0) * quarter) / (ratio * ratio * ratio * w_internal);
}

/* With the convex envelope of f: the one piece that the least lies on is found by bisection. */
mpc_least mpc_costate_least_shared(const mpc_asked *asked, const mpc_prices *price)
{
    const mpc_real net_w = asked->net_w;
    const mpc_real low_w = asked->low_w;
    const mpc_real high_w = asked->high_w;
    const mpc_real w_internal = real_max(price->internal, LEAST_PRICE);
    const mpc_real per = REAL(1.0) / w_internal;
    int32_t piece = 0; /* as far as is known, the least lies on it or further on */
    for (int32_t stride = MPC_SHARED_STRIDE; stride > 0; stride /= 2) {
        const int32_t next = piece + stride;
        const int32_t before = ((next < MPC_SHARED_PIECES) ? next : (MPC_SHARED_PIECES - 1)) - 1;
        const stationary there = stationary_at(net_w, price, per, mpc_par.shared_slope[before]);
        const mpc_real kept = real_min(real_max(there.power_w, low_w), high_w);
        const int32_t is_beyond = (kept > mpc_par.shared_end_w[before]) ? 1 : 0;
        const int32_t exists = (next < MPC_SHARED_PIECES) ? 1 : 0;
        piece += stride * (is_beyond * exists);
    }
    const mpc_real slope = mpc_par.shared_slope[piece];
    const mpc_real begin_w = mpc_par.shared_begin_w[piece];
    const stationary own = stationary_at(net_w, price, per, slope);
    const mpc_real power_w = real_min(real_max(real_max(own.power_w, begin_w), low_w), high_w);
    const mpc_real inside = above(own.power_w, real_max(begin_w, low_w))
                            * above(high_w, own.power_w);
    const mpc_real given = real_min(given_by(own.ratio, w_internal), MOST_GIVEN);
    const mpc_real fuel = (slope * power_w) + mpc_par.shared_intercept[piece];
    const mpc_real internal = internal_w(net_w - power_w);
    const mpc_real cost = (price->fuel * fuel) + (price->power * power_w)
                          + (price->internal * internal);
    const mpc_least found = {{power_w, fuel, internal}, cost, slope, own.ratio, inside * given};
    return found;
}

/* With f by its chords, of any shape: all pieces are compared. */
mpc_least mpc_costate_least_exact(const mpc_asked *asked, const mpc_prices *price)
{
    const mpc_real net_w = asked->net_w;
    const mpc_real per = REAL(1.0) / real_max(price->internal, LEAST_PRICE);
    mpc_least best = {{REAL(0.0), REAL(0.0), REAL(0.0)}, NEVER_G, REAL(0.0), REAL(1.0), REAL(0.0)};
    for (int32_t i = 0; i < MPC_LINE_PIECES; i++) {
        const mpc_real slope = mpc_par.line_slope[i];
        const mpc_real begin = real_max(mpc_par.line_begin_w[i], asked->low_w);
        const mpc_real end = real_min(mpc_par.line_end_w[i], asked->high_w);
        const stationary there = stationary_at(net_w, price, per, slope);
        const mpc_real power_w = real_min(real_max(there.power_w, begin), end);
        const mpc_real fuel = (slope * power_w) + mpc_par.line_intercept[i];
        const mpc_real internal = internal_w(net_w - power_w);
        const mpc_real cost = (price->fuel * fuel) + (price->power * power_w)
                              + (price->internal * internal);
        const int32_t is_better = ((begin <= end) ? 1 : 0) & ((cost < best.cost) ? 1 : 0);
        best.drive.power_w = pick(is_better, power_w, best.drive.power_w);
        best.drive.fuel_g_per_s = pick(is_better, fuel, best.drive.fuel_g_per_s);
        best.drive.internal_w = pick(is_better, internal, best.drive.internal_w);
        best.cost = pick(is_better, cost, best.cost);
    }
    return best;
}
