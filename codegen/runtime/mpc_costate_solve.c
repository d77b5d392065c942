/* Rounds of Newton on the dual: each aims at the solution of the linearised problem and tries one
 * point on the way there, or beyond. The same in Python: qpmpc/costate/solve.py.
 */
#include "mpc_constants.h"
#include "mpc_costate_parts.h"
#include "mpc_model.h"
#include "mpc_real.h"

#define LARGEST REAL(1.0e12)

/* All memory of this method is in the state: there is nothing to claim. */
void mpc_method_claim(const mpc_state *state) { (void)state; }

/* The search is sound, or will be started anew. */
int32_t mpc_method_check(const mpc_state *state)
{
    const mpc_search *const search = &state->search;
    int32_t fine = ((search->here == 0) || (search->here == 1)) ? 1 : 0;
    fine &= ((search->moved >= MPC_MOVES_BOTH) && (search->moved <= MPC_MOVES_HEAT)) ? 1 : 0;
    fine &= ((search->streak >= 0) && (search->streak <= STREAK)) ? 1 : 0;
    return fine & within(search->share, REAL(0.0), MOST_SHARE);
}

void mpc_method_start(mpc_state *state)
{
    mpc_search *const search = &state->search;
    mpc_costate_program_fill(state);
    search->here = 0;
    search->streak = 0;
    search->moved = MPC_MOVES_BOTH;
    search->share = state->cal.search_first_share;
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        mpc_stage *const stage = &state->stage[k];
        stage->dual[0].charge = stage->y[MPC_ROW_CHARGE];
        stage->dual[0].heat = stage->y[MPC_ROW_HEAT];
    }
    mpc_costate_price(state, 0);
    mpc_costate_smooth(state);
    mpc_costate_share(state, 0);
}

int32_t mpc_method_iterate(mpc_state *state, int32_t count)
{
    mpc_search *const search = &state->search;
    for (int32_t n = 0; n < count; n++) {
        const int32_t tried = 1 - search->here;
        mpc_costate_try(state, tried);
        mpc_costate_price(state, tried);
        mpc_costate_share(state, tried);
        const mpc_real rise = search->value[tried] - search->value[search->here];
        const int32_t rises = (rise > state->cal.search_least_rise_g) ? 1 : 0;
        const int32_t streak = (search->streak < STREAK) ? (search->streak + 1) : STREAK;
        const int32_t grows = ((streak >= STREAK) || (search->share < REAL(1.0))) ? 1 : 0;
        const mpc_real grown = real_min(GROWS * search->share, MOST_SHARE);
        const mpc_real more = pick(grows, grown, search->share);
        const int32_t next = (search->moved < MPC_MOVES_HEAT) ? (search->moved + 1)
                                                              : MPC_MOVES_BOTH;
        const mpc_real less = SHRINKS * real_min(search->share, REAL(1.0));
        search->here = (rises != 0) ? tried : search->here;
        search->streak = (rises != 0) ? streak : 0;
        search->moved = (rises != 0) ? MPC_MOVES_BOTH : next;
        search->share = pick(rises, more, less);
    }
    return within(search->value[search->here], -LARGEST, LARGEST);
}
