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

/* Costate of the coolant, backwards; returns the terms of the rows and limits that no variable of a
 * stage is in, g. */
static mpc_real price_coolant(mpc_state *state, int32_t which)
{
    mpc_real sum = REAL(0.0);
    mpc_real next = REAL(0.0);  /* lambda of the next stage */
    mpc_real after = REAL(0.0); /* of the next stage, times its t_before */
    for (int32_t k = MPC_STAGES - 1; k >= 0; k--) {
        const mpc_costate_program *const p = &state->stage[k].p;
        mpc_costate_dual *const dual = &state->stage[k].dual[which];
        dual->nu = ((dual->heat - p->price_t) - after) * p->per_end;
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
    return sum;
}

#if MPC_STARTS
/* Price of a start per on-share, of either sign. */
static mpc_real start_price(const mpc_stage *stage, const mpc_costate_dual *dual)
{
    return real_max(dual->start_g, REAL(0.0)) * stage->p.rises;
}
#endif

/* What a stage pays for its on-share because of starts, g, in `price` of the terms. */
#if MPC_STARTS
static void price_starts(mpc_state *state, int32_t which)
{
    mpc_costate_term *const term = state->search.term;
    const mpc_real on_now = (mpc_real)state->watch.good.engine_on;
    mpc_real after = REAL(0.0);
    for (int32_t k = MPC_STAGES - 1; k >= 0; k--) {
        const mpc_stage *const stage = &state->stage[k];
        const mpc_costate_dual *const dual = &stage->dual[which];
        const mpc_real own = start_price(stage, dual);
        const mpc_real width = stage->p.width;
        const mpc_real decided = width + REAL_ABS(own) + REAL_ABS(after);
        /* cost of on less that of off; where there is no choice as much as decides */
        const mpc_real twice = decided + decided;
        const mpc_real least = (twice * stage->p.cannot) - decided;
        const mpc_real most = decided - (twice * stage->p.must);
        term[k].offset = real_clip(dual->on_g - dual->off_g, least, most) - (REAL(0.5) * width);
        term[k].response = width;
        term[k].low = real_min(after, REAL(0.0));
        term[k].high = real_max(after, REAL(0.0));
        term[k].decay = REAL(1.0);
        term[k].per_decay = REAL(1.0);
        after = own;
    }
    const mpc_real first = (REAL(1.0) - on_now) * real_max(after, REAL(0.0));
    term[0].offset += first;
    mpc_costate_funnel(&state->search, MPC_STAGES, (START_HALF_STEPS * MPC_STAGES) / 2);
    mpc_real edge = REAL(0.0);
    mpc_real before = first;
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        const mpc_real moved = (edge + term[k].offset) + (term[k].response * term[k].price);
        edge = real_clip(moved, term[k].low, term[k].high);
        term[k].price = before - edge;
        before = edge;
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
    mpc_real share;
    mpc_real cost_g;
} way;

static mpc_real heat_of(const mpc_stage_program *of, const mpc_drive *drive)
{
    return (of->per_fuel * drive->fuel_g_per_s) - (of->per_power * drive->power_w);
}

/* Derivatives of the change of SOC to lambda, of that to nu, of the coolant's heat to nu. */
typedef struct {
    mpc_real charge;
    mpc_real cross;
    mpc_real heat;
} responses;

/* The seconds of a longer stage in which the engine must run, at a power of their own. */
static responses drive_forced(mpc_stage *stage, int32_t which)
{
    const mpc_costate_program *const p = &stage->p;
    mpc_costate_dual *const dual = &stage->dual[which];
    const mpc_prices price = mpc_costate_prices(stage, dual);
    const mpc_asked asked = {p->of.forced_net_w, p->of.forced_low_w, p->of.forced_high_w};
    const mpc_least found = mpc_costate_least_shared(&asked, &price);
    const mpc_real v_charge = p->of.charge_per_w * found.ratio;
    const mpc_real v_heat = (p->of.per_fuel * found.slope_g_per_j) - p->of.per_power;
    const mpc_real gives = p->forced * found.gives;
    dual->forced = found.drive;
    dual->forced_g = p->forced * found.cost;
    const responses found_ones = {gives * v_charge * v_charge, gives * v_charge * v_heat,
                                  gives * v_heat * v_heat};
    return found_ones;
}

/* On-share of a stage, and where it leads. */
static void go_on(mpc_stage *stage, int32_t which, mpc_real starts_g, way *at)
{
    const mpc_costate_program *const p = &stage->p;
    const mpc_stage_program *const of = &p->of;
    mpc_costate_dual *const dual = &stage->dual[which];
    const mpc_real per_width = REAL(1.0) / p->width;
    const mpc_real wish = REAL(0.5) - (((dual->on_g - dual->off_g) + starts_g) * per_width);
    const mpc_real clipped = real_clip(wish, REAL(0.0), REAL(1.0));
    const mpc_real share = real_max((REAL(1.0) - p->cannot) * clipped, p->must);
    const mpc_real turn = above(share * (REAL(1.0) - share), REAL(0.0)) * per_width;
    const mpc_real off_w = stage->road.free_internal_off_w;
    const mpc_real by_charge = p->free * of->charge_per_w * (off_w - dual->on.internal_w);
    const mpc_real by_heat = p->free * heat_of(of, &dual->on);
    /* here they are still what the stage gives while on, its slopes */
    const mpc_real gives = p->free * share * dual->of_charge;
    const mpc_real v_charge = dual->cross;
    const mpc_real v_heat = dual->of_heat;
    dual->of_charge = (gives * v_charge * v_charge) + (turn * by_charge * by_charge);
    dual->cross = (gives * v_charge * v_heat) + (turn * by_charge * by_heat);
    dual->of_heat = (gives * v_heat * v_heat) + (turn * by_heat * by_heat);
    dual->share = share;
    const mpc_real spent_w = (p->free * off_w) + (p->forced * dual->forced.internal_w);
    mpc_real change = (share * by_charge) - (of->charge_per_w * spent_w);
    mpc_real heat = (share * by_heat) + (p->forced * heat_of(of, &dual->forced));
#if MPC_STARTS
    const mpc_real starts = real_max(p->rises * (share - at->share), REAL(0.0));
    change -= mpc_par.cranking_soc * starts;
    heat += of->start_k * starts;
#endif
    at->share = share;
    at->soc += change;
    at->t_cl_k = ((of->settled + heat) - (of->t_before * at->t_cl_k)) * p->per_end;
    dual->soc = at->soc;
    dual->t_cl_k = at->t_cl_k;
    at->cost_g += (share * dual->on_g) + ((REAL(1.0) - share) * dual->off_g) + (share * starts_g)
                  + (REAL(0.5) * p->width * ((share * share) - share)) + dual->forced_g;
}

void mpc_costate_dual_at(mpc_state *state, int32_t which)
{
    const mpc_real constant_g = price_coolant(state, which);
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        mpc_stage *const stage = &state->stage[k];
        const mpc_stage_program *const of = &stage->p.of;
        mpc_costate_dual *const dual = &stage->dual[which];
        const mpc_prices price = mpc_costate_prices(stage, dual);
        const mpc_asked asked = asked_of(stage);
        const mpc_least on = mpc_costate_least_shared(&asked, &price);
        dual->on = on.drive;
        dual->on_g = stage->p.free * on.cost;
        dual->off_g = stage->p.free * price.internal * stage->road.free_internal_off_w;
#if MPC_STARTS
        dual->start_g = (mpc_par.start_fuel_g + (dual->charge * mpc_par.cranking_soc))
                        - (dual->nu * of->start_k);
#endif
        dual->of_charge = on.gives;
        dual->cross = of->charge_per_w * on.ratio;
        dual->of_heat = (of->per_fuel * on.slope_g_per_j) - of->per_power;
    }
    price_starts(state, which);
    way at = {REAL(0.0), REAL(0.0), (mpc_real)state->watch.good.engine_on, REAL(0.0)};
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        mpc_stage *const stage = &state->stage[k];
        mpc_costate_dual *const dual = &stage->dual[which];
        responses more = {REAL(0.0), REAL(0.0), REAL(0.0)};
        dual->forced = dual->on;
        dual->forced_g = REAL(0.0);
        if (k >= MPC_SHORT) {
            more = drive_forced(stage, which);
        }
        go_on(stage, which, state->search.term[k].price, &at);
        dual->of_charge += more.charge;
        dual->cross += more.cross;
        dual->of_heat += more.heat;
    }
    state->search.constant_g[which] = constant_g;
    state->search.value[which] = at.cost_g + constant_g;
}
