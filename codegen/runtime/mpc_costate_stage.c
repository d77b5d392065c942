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

/* Prices of a stage; those of fuel and power in that of the battery's store too. */
typedef struct {
    mpc_real fuel;
    mpc_real power;
    mpc_real internal;
    mpc_real per; /* 1 / internal */
    mpc_real fuel_ratio;
    mpc_real power_ratio;
} prices;

/* What a stage answers to them with its engine on. */
typedef struct {
    mpc_drive drive;
    mpc_real cost;
    mpc_real slope_g_per_j;
    mpc_real ratio;
    mpc_real gives; /* dE of a unit of marginal cost */
} least;

static inline prices prices_of(const mpc_stage_program *of, const mpc_costate_dual *dual)
{
    const mpc_real internal = dual->charge * of->charge_per_w;
    const mpc_real per = REAL(1.0) / real_max(internal, LEAST_PRICE);
    const mpc_real fuel = of->fuel_cost - (dual->nu * of->per_fuel);
    const mpc_real power = dual->nu * of->per_power;
    const prices price = {fuel, power, internal, per, fuel * per, power * per};
    return price;
}

/* r of a piece of this slope */
static inline mpc_real ratio_at(const prices *price, mpc_real slope)
{
    return real_max((price->fuel_ratio * slope) + price->power_ratio, LEAST_RATIO);
}

/* U^2 / (4 R) of the battery */
static inline mpc_real quarter_w(int32_t discharges)
{
    return pick(discharges, mpc_par.quarter_discharge_w, mpc_par.quarter_charge_w);
}

/* 1 - 4 R P / U^2 */
static inline mpc_real under_root(mpc_real power_w)
{
    return (REAL(1.0) - (power_w * mpc_par.per_quarter_mean))
           - (REAL_ABS(power_w) * mpc_par.per_quarter_half);
}

/* l(P); beyond the most that the battery can give the current stays. */
static inline mpc_real internal_w(mpc_real power_w)
{
    const mpc_real root = REAL_SQRT(real_max(under_root(power_w), REAL(0.0)));
    const mpc_real most = quarter_w((power_w > REAL(0.0)) ? 1 : 0);
    return (REAL(2.0) * real_min(power_w, most)) / (REAL(1.0) + root);
}

/* A row of the table of pieces: slope, end, begin, intercept. */
enum { SLOPE = 0, END = 1, BEGIN = 2, INTERCEPT = 3, ROW = 4 };

/* Row of the piece of the envelope that the least of all powers lies on, by bisection: the first
 * whose end it does not lie beyond. That is where the slope of l is below r there:
 * r^2 (1 - 4 R P / U^2) < 1. After the pieces come rows that nothing lies beyond. */
static inline const mpc_real *row_of_least(const prices *price, mpc_real net_w)
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
static inline least least_shared(const mpc_costate_asked *asked, const prices *price)
{
    const mpc_real net_w = asked->net_w;
    const mpc_real *const row = row_of_least(price, net_w);
    const mpc_real slope = row[SLOPE];
    const mpc_real ratio = ratio_at(price, slope);
    const mpc_real inverse = REAL(1.0) / ratio;
    const mpc_real square = inverse * inverse;
    const mpc_real quarter = quarter_w((ratio > REAL(1.0)) ? 1 : 0);
    const mpc_real own_w = net_w - (quarter * (REAL(1.0) - square));
    const mpc_real free_w = real_max(own_w, row[BEGIN]);
    const mpc_real power_w = real_clip(free_w, asked->low_w, asked->high_w);
    const mpc_real given = REAL(2.0) * quarter * square * inverse * price->per;
    const mpc_real inside = (power_w == own_w) ? REAL(1.0) : REAL(0.0);
    const mpc_real gives = inside * real_min(given, MOST_GIVEN);
    const mpc_real on_piece = (slope * power_w) + row[INTERCEPT];
    const mpc_real no_less = (free_w < asked->low_w) ? asked->low_g_per_s : on_piece;
    const mpc_real fuel = (free_w > asked->high_w) ? asked->high_g_per_s : no_less;
    const mpc_real internal = internal_w(net_w - power_w);
    const mpc_real cost = (price->fuel * fuel) + (price->power * power_w)
                          + (price->internal * internal);
    const least found = {{power_w, fuel, internal}, cost, slope, ratio, gives};
    return found;
}

/* How charge and heat answer, of a share of the stage. */
static inline mpc_responses responses_of(const mpc_stage_program *of, const least *found,
                                         mpc_real share)
{
    const mpc_real v_charge = of->charge_per_w * found->ratio;
    const mpc_real v_heat = (of->per_fuel * found->slope_g_per_j) - of->per_power;
    const mpc_real gives = share * found->gives;
    const mpc_real by_charge = gives * v_charge;
    const mpc_responses answer = {by_charge * v_charge, by_charge * v_heat, gives * v_heat * v_heat};
    return answer;
}

static inline mpc_real heat_of(const mpc_stage_program *of, const mpc_drive *drive)
{
    return (of->per_fuel * drive->fuel_g_per_s) - (of->per_power * drive->power_w);
}

/* The seconds with a choice. */
static inline void minimise_free(mpc_stage *stage, mpc_costate_dual *dual, const prices *price)
{
    const mpc_costate_program *const p = &stage->p;
    const mpc_real free = p->free;
    const mpc_real off_w = stage->road.free_internal_off_w;
    const least on = least_shared(&p->asked, price);
    stage->answer.by_switch = responses_of(&p->of, &on, free);
    stage->answer.switch_charge = free * p->of.charge_per_w * (off_w - on.drive.internal_w);
    stage->answer.switch_heat = free * heat_of(&p->of, &on.drive);
    dual->on = on.drive;
    dual->on_g = free * on.cost;
    dual->off_g = free * price->internal * off_w;
}

/* Those in which the engine must run, in a longer stage that has both. */
static inline void minimise_forced(mpc_stage *stage, mpc_costate_dual *dual, const prices *price)
{
    const mpc_costate_program *const p = &stage->p;
    const least found = least_shared(&p->forced_asked, price);
    stage->answer.always = responses_of(&p->of, &found, p->forced);
    stage->answer.spent_w = p->forced * found.drive.internal_w;
    stage->answer.heat = p->forced * heat_of(&p->of, &found.drive);
    dual->forced = found.drive;
    dual->forced_g = p->forced * found.cost;
}

void mpc_costate_minimise(mpc_state *state, int32_t which)
{
    static const mpc_responses none = {REAL(0.0), REAL(0.0), REAL(0.0)};
    for (int32_t k = 0; k < MPC_SHORT; k++) {
        mpc_stage *const stage = &state->stage[k];
        mpc_costate_dual *const dual = &stage->dual[which];
        const prices price = prices_of(&stage->p.of, dual);
        minimise_free(stage, dual, &price);
        stage->answer.always = none;
        stage->answer.spent_w = REAL(0.0);
        stage->answer.heat = REAL(0.0);
        dual->forced = dual->on;
        dual->forced_g = REAL(0.0);
    }
    for (int32_t k = MPC_SHORT; k < MPC_STAGES; k++) {
        mpc_stage *const stage = &state->stage[k];
        mpc_costate_dual *const dual = &stage->dual[which];
        const prices price = prices_of(&stage->p.of, dual);
        minimise_free(stage, dual, &price);
        minimise_forced(stage, dual, &price);
    }
}

/* With f by its chords, of any shape: all pieces are compared. */
void mpc_costate_minimise_exactly(mpc_stage *stage, int32_t which)
{
    mpc_costate_dual *const dual = &stage->dual[which];
    const mpc_costate_asked *const asked = &stage->p.asked;
    const prices price = prices_of(&stage->p.of, dual);
    const mpc_real net_w = asked->net_w;
    dual->on_g = NEVER_G;
    for (int32_t i = 0; i < MPC_LINE_PIECES; i++) {
        const mpc_real slope = mpc_par.line_slope[i];
        const mpc_real begin = real_max(mpc_par.line_begin_w[i], asked->low_w);
        const mpc_real end = real_min(mpc_par.line_end_w[i], asked->high_w);
        const mpc_real ratio = ratio_at(&price, slope);
        const mpc_real inverse = REAL(1.0) / ratio;
        const mpc_real quarter = quarter_w((ratio > REAL(1.0)) ? 1 : 0);
        const mpc_real own_w = net_w - (quarter * (REAL(1.0) - (inverse * inverse)));
        const mpc_real power_w = real_min(real_max(own_w, begin), end);
        const mpc_real fuel = (slope * power_w) + mpc_par.line_intercept[i];
        const mpc_real internal = internal_w(net_w - power_w);
        const mpc_real cost = (price.fuel * fuel) + (price.power * power_w)
                              + (price.internal * internal);
        const int32_t is_better = ((begin <= end) ? 1 : 0) & ((cost < dual->on_g) ? 1 : 0);
        dual->on.power_w = pick(is_better, power_w, dual->on.power_w);
        dual->on.fuel_g_per_s = pick(is_better, fuel, dual->on.fuel_g_per_s);
        dual->on.internal_w = pick(is_better, internal, dual->on.internal_w);
        dual->on_g = pick(is_better, cost, dual->on_g);
    }
}
