/* The aim of a round: the problem linearised where the search is, solved first for SOC, then for
 * the coolant, with all their limits: by a funnel and by a scan. The same in Python: qpmpc/costate/solve.py.
 *
 * SOC is limited in each second and at the end of each block, so a block is one term. A coolant
 * limit whose multiplier would be more than the price of its slack gets that price, and is a limit
 * no more.
 */
#include "mpc_constants.h"
#include "mpc_costate_parts.h"
#include "mpc_model.h"
#include "mpc_real.h"

#define DECIDES REAL(1.0e12) /* K per (g/K): a multiplier of more than 1e-10 decides */
#define SOC_TERMS (MPC_SHORT + MPC_BLOCKS)

/* Some stages as one term. The response is that of the stages and, lest there be none, of one that
 * is switched. */
static inline void put_charge(mpc_costate_term *term, const mpc_stage *first, int32_t stages,
                              int32_t which)
{
    const mpc_stage *const last = &first[stages - 1];
    mpc_real offset = REAL(0.0);
    mpc_real sum = REAL(0.0);
    for (int32_t i = 0; i < stages; i++) {
        const mpc_costate_dual *const dual = &first[i].dual[which];
        const mpc_real response = dual->of_charge + first[i].p.least_of_charge;
        offset -= response * dual->charge;
        sum += response;
    }
    term->offset = offset;
    term->response = sum;
    term->limit[0] = last->p.of.soc_low - last->dual[which].soc;
    term->limit[1] = last->p.of.soc_high - last->dual[which].soc;
    term->price = MPC_NO_PRICE;
}

static inline mpc_real charge_of(const mpc_costate_term *term, mpc_real most_g)
{
    return real_clip(term->price, REAL(0.0), most_g);
}

static void aim_charge(mpc_state *state)
{
    const int32_t which = state->search.here;
    const mpc_real most_g = state->cal.fuel_scale * mpc_par.most_charge_g;
    mpc_costate_term *const term = state->search.term;
    mpc_stage *const stage = state->stage;
    for (int32_t k = 0; k < MPC_SHORT; k++) {
        put_charge(&term[k], &stage[k], 1, which);
    }
    for (int32_t i = 0; i < MPC_BLOCKS; i++) {
        const int32_t first = MPC_SHORT + (MPC_CLASSES * i);
        put_charge(&term[MPC_SHORT + i], &stage[first], MPC_CLASSES, which);
    }
    mpc_costate_funnel(&state->search, SOC_TERMS, (CHARGE_QUARTER_STEPS * SOC_TERMS) / 4);
    for (int32_t k = 0; k < MPC_SHORT; k++) {
        stage[k].goal_charge = charge_of(&term[k], most_g);
    }
    for (int32_t i = 0; i < MPC_BLOCKS; i++) {
        const int32_t first = MPC_SHORT + (MPC_CLASSES * i);
        const mpc_real price = charge_of(&term[MPC_SHORT + i], most_g);
        for (int32_t j = 0; j < MPC_CLASSES; j++) {
            stage[first + j].goal_charge = price;
        }
    }
}

static void aim_heat(mpc_state *state)
{
    const int32_t which = state->search.here;
    const mpc_real slack = state->cal.slack_g_per_k;
    const mpc_real most = AT_SLACK * slack;
    const mpc_real of_charge =
        pick((state->search.moved == MPC_MOVES_HEAT) ? 1 : 0, REAL(0.0), REAL(1.0));
    mpc_real change = REAL(0.0); /* M of the limits given up less that of the multipliers now */
    for (int32_t k = MPC_STAGES - 1; k >= 0; k--) {
        mpc_stage *const stage = &state->stage[k];
        mpc_costate_stretch *const term = &state->search.stretch[k + 1];
        const mpc_costate_program *const p = &stage->p;
        const mpc_costate_dual *const dual = &stage->dual[which];
        const mpc_real low = p->of.t_low - dual->t_cl_k;
        const mpc_real high = p->of.t_high - dual->t_cl_k;
        /* a limit that is given up */
        const mpc_real is_cold = not_below(dual->heat, most) * above(low, REAL(0.0));
        const mpc_real is_hot = not_below(-most, dual->heat) * above(REAL(0.0), high);
        const mpc_real given = slack * (is_cold - is_hot);
        /* that which has a multiplier, else the nearer: by a sum whose sign the multiplier decides */
        const mpc_real lower = not_below((dual->heat * DECIDES) + (low + high), REAL(0.0));
        const mpc_real more = of_charge * dual->cross * (stage->goal_charge - dual->charge);
        stage->given_heat = given;
        change += given - dual->heat;
        term->response = (dual->of_heat + p->least_of_heat) * p->per_end * p->per_end;
        term->offset = (more * p->per_end) + (term->response * change);
        term->limit = blend(lower, low, high);
        const mpc_real is_limit = not_below(term->response, LEAST_RESPONSE)
                                  * (REAL(1.0) - (is_cold + is_hot));
        term->side = ((lower + lower) - REAL(1.0)) * is_limit;
        term->decay = p->decay;
        change *= p->decay;
    }
    mpc_costate_scan(&state->search);
}

/* The point to try, with multipliers of the right sign: so far on the way to the aim, or beyond. One
 * of the coolant ends at 0 where it would change its sign. */
static void go_towards(mpc_state *state, int32_t tried)
{
    const mpc_search *const search = &state->search;
    const mpc_real of_heat =
        pick((search->moved == MPC_MOVES_CHARGE) ? 1 : 0, REAL(0.0), search->share);
    const mpc_real of_charge =
        pick((search->moved == MPC_MOVES_HEAT) ? 1 : 0, REAL(0.0), search->share);
    const mpc_real slack = state->cal.slack_g_per_k;
    int32_t met = search->met;
    for (int32_t k = MPC_STAGES - 1; k >= 0; k--) {
        mpc_stage *const stage = &state->stage[k];
        const mpc_costate_dual *const here = &stage->dual[1 - tried];
        mpc_costate_dual *const there = &stage->dual[tried];
        const int32_t is_met = (search->stretch[met].at == (k + 1)) ? 1 : 0;
        const mpc_real jump = (mpc_real)is_met * search->stretch[met].jump;
        const mpc_real goal = real_clip(jump + stage->given_heat, -slack, slack);
        const mpc_real heat = here->heat + (of_heat * (goal - here->heat));
        const mpc_real charge = here->charge + (of_charge * (stage->goal_charge - here->charge));
        const mpc_real least = pick(here->heat > REAL(0.0), REAL(0.0), -slack);
        const mpc_real greatest = pick(here->heat < REAL(0.0), REAL(0.0), slack);
        there->heat = real_clip(heat, least, greatest);
        there->charge = real_max(charge, REAL(0.0));
        met -= is_met;
    }
}

void mpc_costate_try(mpc_state *state, int32_t tried)
{
    aim_charge(state);
    aim_heat(state);
    go_towards(state, tried);
}
