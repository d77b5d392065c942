/* The smoothed dual of the program: its value, and how the stages answer to their prices.
 *
 * In each stage sigma J_on + (1 - sigma) J_off + W / 2 (sigma^2 - sigma) is minimised over sigma;
 * starts couple the stages by prices, found by a funnel. The same in Python, with the reasons:
 * qpmpc/costate/dual.py.
 */
#include "mpc_constants.h"
#include "mpc_costate_parts.h"
#include "mpc_model.h"
#include "mpc_real.h"

void mpc_costate_price(mpc_state *state, int32_t which)
{
    mpc_real sum = REAL(0.0);
    mpc_real next = REAL(0.0);  /* lambda of the next stage */
    mpc_real after = REAL(0.0); /* of the next stage, times its t_before */
    for (int32_t k = MPC_STAGES - 1; k >= 0; k--) {
        const mpc_costate_program *const p = &state->stage[k].p;
        mpc_costate_dual *const dual = &state->stage[k].dual[which];
        dual->nu = ((dual->heat - p->price_t) - after) * p->per_end;
        dual->off_g = dual->charge * p->off_charge;
#if MPC_STARTS
        dual->start_g = (state->cal.start_fuel_g + (dual->charge * mpc_par.cranking_soc))
                        - (dual->nu * p->of.start_k);
#endif
        after = p->of.t_before * dual->nu;
        /* a lower limit where the multiplier is above 0, an upper one where it is below */
        const mpc_real jump = dual->charge - next;
        sum += (p->of.soc_low * real_max(jump, REAL(0.0)))
               + (p->of.soc_high * real_min(jump, REAL(0.0)));
        sum += (p->of.t_low * real_max(dual->heat, REAL(0.0)))
               + (p->of.t_high * real_min(dual->heat, REAL(0.0)));
        sum -= dual->nu * p->of.settled;
        next = dual->charge;
    }
    state->search.constant_g[which] = sum;
    mpc_costate_minimise(state, which);
}

#if MPC_STARTS
/* Price of a start per on-share, of either sign. */
static mpc_real start_price(const mpc_stage *stage, const mpc_costate_dual *dual)
{
    return real_max(dual->start_g, REAL(0.0)) * stage->p.rises;
}

/* Cost of on less that of off; where there is no choice as much as decides: beyond the prices of
 * the starts before and after no start is worth it. */
static mpc_real difference_g(const mpc_costate_program *p, const mpc_costate_dual *dual,
                             mpc_real own, mpc_real after)
{
    const mpc_real decided = p->width + REAL_ABS(own) + REAL_ABS(after);
    const mpc_real twice = decided + decided;
    const mpc_real least = (twice * p->cannot) - decided;
    const mpc_real most = decided - (twice * p->must);
    return real_clip(dual->on_g[MPC_FREE] - dual->off_g, least, most);
}

/* The seconds ahead are a chain. */
static void price_starts_ahead(mpc_state *state, int32_t which)
{
    mpc_costate_term *const term = state->search.term;
    const mpc_real on_now = (mpc_real)state->watch.good.engine_on;
    mpc_real after = REAL(0.0);
    for (int32_t k = MPC_SHORT - 1; k >= 0; k--) {
        const mpc_stage *const stage = &state->stage[k];
        const mpc_costate_dual *const dual = &stage->dual[which];
        const mpc_real own = start_price(stage, dual);
        const mpc_real width = stage->p.width;
        term[k].offset = difference_g(&stage->p, dual, own, after) - (REAL(0.5) * width);
        term[k].response = width;
        term[k].limit[0] = real_min(after, REAL(0.0));
        term[k].limit[1] = real_max(after, REAL(0.0));
        term[k].price = MPC_NO_PRICE;
        after = own;
    }
    const mpc_real first = (REAL(1.0) - on_now) * real_max(after, REAL(0.0));
    term[0].offset += first;
    mpc_costate_funnel(&state->search, MPC_SHORT, (START_QUARTER_STEPS * MPC_SHORT) / 4);
    mpc_real edge = REAL(0.0);
    mpc_real before = first;
    for (int32_t k = 0; k < MPC_SHORT; k++) {
        const mpc_real moved = (edge + term[k].offset) + (term[k].response * term[k].price);
        edge = real_clip(moved, term[k].limit[0], term[k].limit[1]);
        term[k].price = before - edge;
        before = edge;
    }
}

#if MPC_CLASSES > 1
/* The stages of a block, which are three, in closed form: the price between the first two is the
 * best for any between the last two, whose own best is therefore that of the one or the other
 * limit, or of none. */
static void price_starts_of_block(const mpc_stage *block, int32_t which, mpc_costate_term *term)
{
    const mpc_costate_dual *const first = &block[0].dual[which];
    const mpc_costate_dual *const middle = &block[1].dual[which];
    const mpc_costate_dual *const last = &block[2].dual[which];
    const mpc_real one = start_price(&block[1], middle);
    const mpc_real two = start_price(&block[2], last);
    const mpc_real first_g = difference_g(&block[0].p, first, REAL(0.0), one);
    const mpc_real middle_g = difference_g(&block[1].p, middle, one, two);
    const mpc_real last_g = difference_g(&block[2].p, last, two, REAL(0.0));
    const mpc_real w_first = block[0].p.width;
    const mpc_real w_middle = block[1].p.width;
    const mpc_real w_last = block[2].p.width;
    const mpc_real low = real_min(one, REAL(0.0));
    const mpc_real high = real_max(one, REAL(0.0));
    const mpc_real per = REAL(1.0) / (w_first + w_middle);
    const mpc_real known = ((first_g * w_middle) - (middle_g * w_first)) * per;
    const mpc_real follows = w_first * per;
    const mpc_real right = (middle_g * w_last) - (last_g * w_middle);
    const mpc_real per_last = REAL(1.0) / (w_middle + w_last);
    const mpc_real at_low = (right + (low * w_last)) * per_last;
    const mpc_real at_high = (right + (high * w_last)) * per_last;
    const mpc_real free = (right + (known * w_last))
                          / (w_middle + ((REAL(1.0) - follows) * w_last));
    const mpc_real best = real_clip(free, at_low, at_high);
    const mpc_real second = real_clip(best, real_min(two, REAL(0.0)), real_max(two, REAL(0.0)));
    const mpc_real edge = real_clip(known + (follows * second), low, high);
    term[0].price = -edge;
    term[1].price = edge - second;
    term[2].price = second;
}
#endif

/* What a stage pays for its on-share because of starts, g, in `price` of the terms. */
static void price_starts(mpc_state *state, int32_t which)
{
    price_starts_ahead(state, which);
    for (int32_t k = MPC_SHORT; k < MPC_STAGES; k += MPC_CLASSES) {
#if MPC_CLASSES > 1
        price_starts_of_block(&state->stage[k], which, &state->search.term[k]);
#else
        state->search.term[k].price = REAL(0.0);
#endif
    }
}
#else
static void price_starts(mpc_state *state, int32_t which)
{
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        state->search.term[k].price = REAL(0.0);
    }
    (void)which;
}
#endif

/* SOC, coolant temperature and starts on the way, from stage to stage. */
typedef struct {
    mpc_real soc;
    mpc_real t_cl_k;
    mpc_real cost_g;
#if MPC_STARTS
    mpc_real share;
#endif
} way;

/* On-share of a stage, and where it leads. */
static void go_on(mpc_stage *stage, int32_t which, mpc_real starts_g, way *at)
{
    const mpc_costate_program *const p = &stage->p;
    const mpc_costate_answer *const free = &stage->answer[MPC_FREE];
    const mpc_costate_answer *const forced = &stage->answer[MPC_FORCED];
    mpc_costate_dual *const dual = &stage->dual[which];
    const mpc_real by_charge = p->off_charge - free->charge; /* by on instead of off */
    const mpc_real by_heat = free->heat;
    const mpc_real difference = (dual->on_g[MPC_FREE] - dual->off_g) + starts_g;
    const mpc_real wish = real_clip(REAL(0.5) - (difference * p->per_width), REAL(0.0), REAL(1.0));
    const mpc_real share = real_max((REAL(1.0) - p->cannot) * wish, p->must);
    const mpc_real rest = REAL(1.0) - share;
    const mpc_real turn = above(share * rest, EDGE) * p->per_width;
    const mpc_real turn_charge = turn * by_charge;
    dual->share = share;
    dual->of_charge = forced->to_prices.charge + (share * free->to_prices.charge)
                      + (turn_charge * by_charge);
    dual->cross = forced->to_prices.cross + (share * free->to_prices.cross)
                  + (turn_charge * by_heat);
    dual->of_heat = forced->to_prices.heat + (share * free->to_prices.heat)
                    + (turn * by_heat * by_heat);
    mpc_real change = ((share * by_charge) - p->off_charge) - forced->charge;
    mpc_real heat = (share * by_heat) + forced->heat;
#if MPC_STARTS
    const mpc_real starts = real_max(p->rises * (share - at->share), REAL(0.0));
    change -= mpc_par.cranking_soc * starts;
    heat += p->of.start_k * starts;
    at->share = share;
#endif
    at->soc += change;
    at->t_cl_k = ((p->of.settled + heat) - (p->of.t_before * at->t_cl_k)) * p->per_end;
    dual->soc = at->soc;
    dual->t_cl_k = at->t_cl_k;
    at->cost_g += (dual->off_g + dual->on_g[MPC_FORCED])
                  + (share * (difference - (REAL(0.5) * p->width * rest)));
}

void mpc_costate_share(mpc_state *state, int32_t which)
{
    price_starts(state, which);
#if MPC_STARTS
    way at = {REAL(0.0), REAL(0.0), REAL(0.0), (mpc_real)state->watch.good.engine_on};
#else
    way at = {REAL(0.0), REAL(0.0), REAL(0.0)};
#endif
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        go_on(&state->stage[k], which, state->search.term[k].price, &at);
    }
    state->search.value[which] = at.cost_g + state->search.constant_g[which];
}
