/* The least of the stages with their engines on, at given prices, with the convex envelope of f:
 *
 *     min_E  w_F f(E) + w_E E + w_G l(P0 - E)   between the limits of E
 *
 * On a piece of f of slope a the slope of l has to be r = (w_F a + w_E) / w_G, at the battery power
 * U^2 (1 - 1 / r^2) / (4 R). The same in Python: qpmpc/pwa/priced.py.
 *
 * A processor with vectors has several stages side by side, in lanes; those left over hold the last.
 */
#define MPC_IN_LANES /* minima that compilers make vectors of, see mpc_arithmetic.h */
#include "mpc_constants.h"
#include "mpc_costate_parts.h"
#include "mpc_model.h"
#include "mpc_priced.h"
#include "mpc_real.h"

#if defined(__SSE2__) || defined(__aarch64__)
#define LANES 20
#else
#define LANES 1
#endif

#define MOST_GIVEN REAL(1.0e30) /* finite where the price is nil */

/* A part of some stages at the prices of a dual, see stage_prices, mpc_stage_program and
 * mpc_costate_part. */
typedef struct {
    mpc_stage *stage[LANES];
    mpc_costate_dual *dual[LANES];
    mpc_real fuel[LANES];
    mpc_real power[LANES];
    mpc_real internal[LANES];
    mpc_real per[LANES];
    mpc_real fuel_ratio[LANES];
    mpc_real power_ratio[LANES];
    mpc_real charge_per_w[LANES];
    mpc_real per_fuel[LANES];
    mpc_real per_power[LANES];
    mpc_real share[LANES];
    mpc_real net_w[LANES];
    mpc_real low_w[LANES];
    mpc_real high_w[LANES];
    mpc_real low_g_per_s[LANES];
    mpc_real high_g_per_s[LANES];
} parts;

/* What it answers to the prices, as in mpc_costate_answer, with its engine on. */
typedef struct {
    mpc_real power_w[LANES];
    mpc_real fuel_g_per_s[LANES];
    mpc_real internal_w[LANES];
    mpc_real cost[LANES];
    mpc_real by_charge[LANES];
    mpc_real cross[LANES];
    mpc_real by_heat[LANES];
    mpc_real charge[LANES];
    mpc_real heat[LANES];
} answers;

/* A stage of this group, or where it ends. */
static inline int32_t same_group(int32_t k, int32_t end)
{
#if LANES > 1
    return (k < end) ? k : end;
#else
    (void)end;
    return k;
#endif
}

static inline parts gather(mpc_state *state, int32_t which, int32_t first, int32_t last,
                           int32_t part)
{
    parts of;
    mpc_real charge[LANES];
    mpc_real nu[LANES];
    mpc_real fuel_cost[LANES];
    for (int32_t i = 0; i < LANES; i++) {
        mpc_stage *const stage = &state->stage[same_group(first + i, last)];
        const mpc_costate_part *const own = &stage->p.part[part];
        of.stage[i] = stage;
        of.dual[i] = &stage->dual[which];
        charge[i] = of.dual[i]->charge;
        nu[i] = of.dual[i]->nu;
        fuel_cost[i] = stage->p.of.fuel_cost;
        of.charge_per_w[i] = stage->p.of.charge_per_w;
        of.per_fuel[i] = stage->p.of.per_fuel;
        of.per_power[i] = stage->p.of.per_power;
        of.share[i] = own->share;
        of.net_w[i] = own->net_w;
        of.low_w[i] = own->low_w;
        of.high_w[i] = own->high_w;
        of.low_g_per_s[i] = own->low_g_per_s;
        of.high_g_per_s[i] = own->high_g_per_s;
    }
    for (int32_t i = 0; i < LANES; i++) {
        const stage_prices price = prices_at(charge[i] * of.charge_per_w[i],
                                             fuel_cost[i] - (nu[i] * of.per_fuel[i]),
                                             nu[i] * of.per_power[i]);
        of.fuel[i] = price.fuel;
        of.power[i] = price.power;
        of.internal[i] = price.internal;
        of.per[i] = price.per;
        of.fuel_ratio[i] = price.fuel_ratio;
        of.power_ratio[i] = price.power_ratio;
    }
    return of;
}

static inline stage_prices prices_in(const parts *of, int32_t i)
{
    const stage_prices price = {of->fuel[i], of->power[i],      of->internal[i],
                                of->per[i],  of->fuel_ratio[i], of->power_ratio[i]};
    return price;
}

/* A row of the table of pieces: slope, end, begin, intercept. */
enum { SLOPE = 0, END = 1, BEGIN = 2, INTERCEPT = 3, ROW = 4 };

/* Rows of the pieces of the envelope that the least of all powers lies on, by bisection: the first
 * whose end it does not lie beyond. That is where the slope of l is below r there:
 * r^2 (1 - 4 R P / U^2) < 1. After the pieces come rows that nothing lies beyond. */
static inline void find_rows(const parts *of, const mpc_real **row)
{
    mpc_real slope[LANES];
    mpc_real end_w[LANES];
    mpc_real beyond[LANES];
    for (int32_t i = 0; i < LANES; i++) {
        row[i] = &mpc_par.shared[0];
    }
    for (int32_t stride = MPC_SHARED_STRIDE; stride > 0; stride /= 2) {
        const int32_t last = (stride - 1) * ROW;
        for (int32_t i = 0; i < LANES; i++) {
            slope[i] = row[i][last + SLOPE];
            end_w[i] = row[i][last + END];
        }
        for (int32_t i = 0; i < LANES; i++) {
            const stage_prices price = prices_in(of, i);
            const mpc_real ratio = ratio_at(&price, slope[i]);
            beyond[i] = ratio * ratio * under_root(of->net_w[i] - end_w[i]);
        }
        for (int32_t i = 0; i < LANES; i++) {
            row[i] = (beyond[i] < REAL(1.0)) ? &row[i][stride * ROW] : row[i];
        }
    }
}

mpc_real mpc_costate_shared_fuel(mpc_real power_w)
{
    const mpc_real *row = &mpc_par.shared[0];
    for (int32_t stride = MPC_SHARED_STRIDE; stride > 0; stride /= 2) {
        row = (power_w > row[((stride - 1) * ROW) + END]) ? &row[stride * ROW] : row;
    }
    return (row[SLOPE] * power_w) + row[INTERCEPT];
}

/* The envelope rises and no line of it lies above it: so at a limit of E fuel is the greatest of three. */
static inline answers minimise_shared(const parts *of)
{
    answers answer;
    const mpc_real *row[LANES];
    mpc_real slopes[LANES];
    mpc_real begin_w[LANES];
    mpc_real intercept[LANES];
    const mpc_real steepest = mpc_par.shared[(((2 * MPC_SHARED_STRIDE) - 1) * ROW) + SLOPE];
    find_rows(of, row);
    for (int32_t i = 0; i < LANES; i++) {
        slopes[i] = row[i][SLOPE];
        begin_w[i] = row[i][BEGIN];
        intercept[i] = row[i][INTERCEPT];
    }
    for (int32_t i = 0; i < LANES; i++) {
        const stage_prices price = prices_in(of, i);
        const mpc_real net_w = of->net_w[i];
        const mpc_real high_w = of->high_w[i];
        const mpc_real share = of->share[i];
        const mpc_real slope = slopes[i];
        const mpc_real ratio = ratio_at(&price, slope);
        const mpc_real inverse = REAL(1.0) / ratio;
        const mpc_real square = inverse * inverse;
        const mpc_real quarter = quarter_w((ratio > REAL(1.0)) ? 1 : 0);
        const mpc_real own_w = stationary_w(net_w, ratio);
        const mpc_real free_w = real_max(own_w, begin_w[i]);
        const mpc_real power_w = real_clip(free_w, of->low_w[i], high_w);
        const mpc_real given = REAL(2.0) * quarter * square * inverse * price.per;
        const mpc_real inside = (power_w == own_w) ? REAL(1.0) : REAL(0.0);
        const mpc_real gives = share * (inside * real_min(given, MOST_GIVEN));
        const mpc_real on_piece = (slope * power_w) + intercept[i];
        const mpc_real from_high = of->high_g_per_s[i] - (steepest * (high_w - power_w));
        const mpc_real fuel = real_max(real_max(on_piece, of->low_g_per_s[i]), from_high);
        const mpc_real internal = internal_w(net_w - power_w);
        const mpc_real cost = (price.fuel * fuel) + (price.power * power_w)
                              + (price.internal * internal);
        const mpc_real v_charge = of->charge_per_w[i] * ratio;
        const mpc_real v_heat = (of->per_fuel[i] * slope) - of->per_power[i];
        const mpc_real by_charge = gives * v_charge;
        answer.power_w[i] = power_w;
        answer.fuel_g_per_s[i] = fuel;
        answer.internal_w[i] = internal;
        answer.cost[i] = share * cost;
        answer.by_charge[i] = by_charge * v_charge;
        answer.cross[i] = by_charge * v_heat;
        answer.by_heat[i] = gives * v_heat * v_heat;
        answer.charge[i] = share * of->charge_per_w[i] * internal;
        answer.heat[i] = share * ((of->per_fuel[i] * fuel) - (of->per_power[i] * power_w));
    }
    return answer;
}

static inline void give(const parts *of, const answers *found, int32_t part)
{
    for (int32_t i = 0; i < LANES; i++) {
        mpc_costate_answer *const answer = &of->stage[i]->answer[part];
        answer->to_prices.charge = found->by_charge[i];
        answer->to_prices.cross = found->cross[i];
        answer->to_prices.heat = found->by_heat[i];
        answer->charge = found->charge[i];
        answer->heat = found->heat[i];
        const mpc_drive drive = {found->power_w[i], found->fuel_g_per_s[i], found->internal_w[i]};
        of->dual[i]->drive[part] = drive;
        of->dual[i]->on_g[part] = found->cost[i];
    }
}

void mpc_costate_minimise(mpc_state *state, int32_t which)
{
    int32_t k = 0;
    while (k < MPC_STAGES) {
        const int32_t end = (k < MPC_SHORT) ? MPC_SHORT : MPC_STAGES;
        const int32_t count = (k < MPC_SHORT) ? 1 : MPC_PARTS;
        for (int32_t i = 0; i < count; i++) {
            parts of;
            answers found;
            of = gather(state, which, k, end - 1, i);
            found = minimise_shared(&of);
            give(&of, &found, i);
        }
        k = same_group(k + LANES, end);
    }
}
