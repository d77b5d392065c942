/* The aim of a round: the problem linearised where the search is, solved first for SOC, then for
 * the coolant, each with all its limits by a funnel. The same in Python: qpmpc/costate/solve.py.
 *
 * SOC is limited in each second and at the end of each block, so a block is one term. A coolant
 * limit whose multiplier would be more than the price of its slack gets that price, and is a limit
 * no more.
 */
#include "mpc_constants.h"
#include "mpc_costate_parts.h"
#include "mpc_model.h"
#include "mpc_real.h"

#define NO_LIMIT REAL(1.0e9)
#define SOC_TERMS (MPC_SHORT + MPC_BLOCKS)

static int32_t of_block(int32_t term) { return MPC_SHORT + (MPC_CLASSES * (term - MPC_SHORT)); }

/* The response is that of the stage and, lest there be none, of one that is switched. */
static void add_charge(mpc_costate_term *term, const mpc_stage *stage, int32_t which)
{
    const mpc_costate_dual *const dual = &stage->dual[which];
    const mpc_real response = dual->of_charge + stage->p.least_of_charge;
    term->offset -= response * dual->charge;
    term->response += response;
    term->limit[0] = stage->p.of.soc_low - dual->soc; /* of the last stage */
    term->limit[1] = stage->p.of.soc_high - dual->soc;
}

static void aim_charge(mpc_state *state)
{
    const int32_t which = state->search.here;
    mpc_costate_term *const term = state->search.term;
    for (int32_t i = 0; i < SOC_TERMS; i++) {
        const int32_t stages = (i < MPC_SHORT) ? 1 : MPC_CLASSES;
        const int32_t first = (i < MPC_SHORT) ? i : of_block(i);
        term[i].price = MPC_NO_PRICE;
        term[i].offset = REAL(0.0);
        term[i].response = REAL(0.0);
        for (int32_t k = first; k < (first + stages); k++) {
            add_charge(&term[i], &state->stage[k], which);
        }
    }
    mpc_costate_funnel(&state->search, SOC_TERMS, (CHARGE_HALF_STEPS * SOC_TERMS) / 2);
    for (int32_t i = 0; i < SOC_TERMS; i++) {
        const int32_t stages = (i < MPC_SHORT) ? 1 : MPC_CLASSES;
        const int32_t first = (i < MPC_SHORT) ? i : of_block(i);
        const mpc_real price = real_clip(term[i].price, REAL(0.0), mpc_par.most_charge_g);
        for (int32_t k = first; k < (first + stages); k++) {
            state->stage[k].goal_charge = price;
        }
    }
}

/* Multiplier of a coolant limit that is given up; 0 where none is. */
static mpc_real given_up(const mpc_stage *stage, const mpc_costate_dual *dual)
{
    const mpc_real most = AT_SLACK * mpc_par.slack_g_per_k;
    const mpc_real is_cold = not_below(dual->heat, most) * above(stage->p.of.t_low, dual->t_cl_k);
    const mpc_real is_hot = not_below(-most, dual->heat) * above(dual->t_cl_k, stage->p.of.t_high);
    return mpc_par.slack_g_per_k * (is_cold - is_hot);
}

static void aim_heat(mpc_state *state)
{
    const int32_t which = state->search.here;
    mpc_costate_term *const term = state->search.term;
    const mpc_real slack = mpc_par.slack_g_per_k;
    mpc_real given = REAL(0.0); /* M of the limits given up, and of the present multipliers */
    mpc_real present = REAL(0.0);
    for (int32_t k = MPC_STAGES - 1; k >= 0; k--) {
        mpc_stage *const stage = &state->stage[k];
        const mpc_costate_program *const p = &stage->p;
        const mpc_costate_dual *const dual = &stage->dual[which];
        const mpc_real own = given_up(stage, dual);
        const mpc_real more = dual->cross * (stage->goal_charge - dual->charge);
        stage->goal_heat = own;
        given += own;
        present += dual->heat;
        term[k].response = (dual->of_heat + p->least_of_heat) * p->per_end * p->per_end;
        term[k].offset = (more * p->per_end) + (term[k].response * (given - present));
        term[k].limit[0] = (p->of.t_low - dual->t_cl_k) - (NO_LIMIT * above(own, REAL(0.0)));
        term[k].limit[1] = (p->of.t_high - dual->t_cl_k) + (NO_LIMIT * above(REAL(0.0), own));
        term[k].decay = p->decay;
        term[k].price = MPC_NO_PRICE;
        given *= p->decay;
        present *= p->decay;
    }
    mpc_costate_funnel_decaying(&state->search, MPC_STAGES, (HEAT_HALF_STEPS * MPC_STAGES) / 2);
    mpc_real after = REAL(0.0); /* price of the next stage, times its decay */
    for (int32_t k = MPC_STAGES - 1; k >= 0; k--) {
        mpc_stage *const stage = &state->stage[k];
        const mpc_real jump = term[k].price - after;
        stage->goal_heat = real_clip(jump + stage->goal_heat, -slack, slack);
        after = term[k].price * stage->p.decay;
    }
}

void mpc_costate_aim(mpc_state *state)
{
    aim_charge(state);
    aim_heat(state);
}
