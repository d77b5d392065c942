/* The least of one stage with its engine on, at given prices, in closed form:
 *
 *     min_E  w_F f(E) + w_E E + w_G l(P0 - E)   between the limits of E
 *
 * On a piece of f of slope a the slope of l has to be r = (w_F a + w_E) / w_G, at the battery power
 * U^2 (1 - 1 / r^2) / (4 R). The same in Python: qpmpc/pwa/priced.py.
 */
#include "mpc_constants.h"
#include "mpc_costate_parts.h"
#include "mpc_model.h"
#include "mpc_priced.h"
#include "mpc_real.h"

#define MOST_GIVEN REAL(1.0e30) /* finite where the price is nil */

/* What a part answers to them with its engine on. */
typedef struct {
    mpc_drive drive;
    mpc_real cost;
    mpc_real slope_g_per_j;
    mpc_real ratio;
    mpc_real gives; /* dE of a unit of marginal cost */
} least;

static inline stage_prices prices_of(const mpc_stage_program *of, const mpc_costate_dual *dual)
{
    const mpc_real internal = dual->charge * of->charge_per_w;
    const mpc_real per = REAL(1.0) / real_max(internal, LEAST_PRICE);
    const mpc_real fuel = of->fuel_cost - (dual->nu * of->per_fuel);
    const mpc_real power = dual->nu * of->per_power;
    const stage_prices price = {fuel, power, internal, per, fuel * per, power * per};
    return price;
}

/* A row of the table of pieces: slope, end, begin, intercept. */
enum { SLOPE = 0, END = 1, BEGIN = 2, INTERCEPT = 3, ROW = 4 };

/* Row of the piece of the envelope that the least of all powers lies on, by bisection: the first
 * whose end it does not lie beyond. That is where the slope of l is below r there:
 * r^2 (1 - 4 R P / U^2) < 1. After the pieces come rows that nothing lies beyond. */
static inline const mpc_real *row_of_least(const stage_prices *price, mpc_real net_w)
{
    const mpc_real *row = &mpc_par.shared[0];
    for (int32_t stride = MPC_SHARED_STRIDE; stride > 0; stride /= 2) {
        const int32_t last = (stride - 1) * ROW;
        const mpc_real ratio = ratio_at(price, row[last + SLOPE]);
        const mpc_real under = under_root(net_w - row[last + END]);
        row = ((ratio * ratio * under) < REAL(1.0)) ? &row[stride * ROW] : row;
    }
    return row;
}

mpc_real mpc_costate_shared_fuel(mpc_real power_w)
{
    const mpc_real *row = &mpc_par.shared[0];
    for (int32_t stride = MPC_SHARED_STRIDE; stride > 0; stride /= 2) {
        row = (power_w > row[((stride - 1) * ROW) + END]) ? &row[stride * ROW] : row;
    }
    return (row[SLOPE] * power_w) + row[INTERCEPT];
}

/* With the convex envelope of f. */
static inline least least_shared(const mpc_costate_part *part, const stage_prices *price)
{
    const mpc_real net_w = part->net_w;
    const mpc_real *const row = row_of_least(price, net_w);
    const mpc_real slope = row[SLOPE];
    const mpc_real ratio = ratio_at(price, slope);
    const mpc_real inverse = REAL(1.0) / ratio;
    const mpc_real square = inverse * inverse;
    const mpc_real quarter = quarter_w((ratio > REAL(1.0)) ? 1 : 0);
    const mpc_real own_w = stationary_w(net_w, ratio);
    const mpc_real free_w = real_max(own_w, row[BEGIN]);
    const mpc_real power_w = real_clip(free_w, part->low_w, part->high_w);
    const mpc_real given = REAL(2.0) * quarter * square * inverse * price->per;
    const mpc_real inside = (power_w == own_w) ? REAL(1.0) : REAL(0.0);
    const mpc_real gives = inside * real_min(given, MOST_GIVEN);
    const mpc_real on_piece = (slope * power_w) + row[INTERCEPT];
    const mpc_real no_less = (free_w < part->low_w) ? part->low_g_per_s : on_piece;
    const mpc_real fuel = (free_w > part->high_w) ? part->high_g_per_s : no_less;
    const mpc_real internal = internal_w(net_w - power_w);
    const mpc_real cost = (price->fuel * fuel) + (price->power * power_w)
                          + (price->internal * internal);
    const least found = {{power_w, fuel, internal}, cost, slope, ratio, gives};
    return found;
}

void mpc_costate_minimise(mpc_state *state, int32_t which)
{
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        mpc_stage *const stage = &state->stage[k];
        const mpc_stage_program *const of = &stage->p.of;
        mpc_costate_dual *const dual = &stage->dual[which];
        const stage_prices price = prices_of(of, dual);
        const int32_t parts = (k < MPC_SHORT) ? 1 : MPC_PARTS;
        for (int32_t i = 0; i < parts; i++) {
            const mpc_costate_part *const part = &stage->p.part[i];
            mpc_costate_answer *const answer = &stage->answer[i];
            const least on = least_shared(part, &price);
            const mpc_real v_charge = of->charge_per_w * on.ratio;
            const mpc_real v_heat = (of->per_fuel * on.slope_g_per_j) - of->per_power;
            const mpc_real gives = part->share * on.gives;
            const mpc_real by_charge = gives * v_charge;
            answer->to_prices.charge = by_charge * v_charge;
            answer->to_prices.cross = by_charge * v_heat;
            answer->to_prices.heat = gives * v_heat * v_heat;
            answer->charge = part->share * of->charge_per_w * on.drive.internal_w;
            answer->heat =
                part->share
                * ((of->per_fuel * on.drive.fuel_g_per_s) - (of->per_power * on.drive.power_w));
            dual->drive[i] = on.drive;
            dual->on_g[i] = part->share * on.cost;
        }
    }
}

/* With f by its chords, of any shape: all pieces are compared. */
void mpc_costate_minimise_exactly(mpc_stage *stage, int32_t which)
{
    mpc_costate_dual *const dual = &stage->dual[which];
    const mpc_costate_part *const part = &stage->p.part[MPC_FREE];
    mpc_drive *const on = &dual->drive[MPC_FREE];
    const stage_prices price = prices_of(&stage->p.of, dual);
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
