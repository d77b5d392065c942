/* Functions that the files of the costate method share. */
#ifndef MPC_COSTATE_PARTS_H
#define MPC_COSTATE_PARTS_H

#include "mpc_parts.h"
#include "mpc_real.h"

/* A choice without a branch. */
static inline mpc_real pick(int32_t condition, mpc_real yes, mpc_real no)
{
    return (condition != 0) ? yes : no;
}

/* mpc_costate_program.c */
void mpc_costate_program_fill(mpc_state *state);

/* mpc_costate_stage.c */
mpc_prices mpc_costate_prices(const mpc_stage *stage, const mpc_costate_dual *dual);
mpc_least mpc_costate_least_shared(const mpc_asked *asked, const mpc_prices *price);
mpc_least mpc_costate_least_exact(const mpc_asked *asked, const mpc_prices *price);

/* What is asked of a stage in the seconds with a choice. */
static inline mpc_asked asked_of(const mpc_stage *stage)
{
    const mpc_asked asked = {stage->road.free_net_w, stage->p.of.low_w, stage->p.of.high_w};
    return asked;
}

/* mpc_costate_funnel.c: prices of the first terms, in `price` */
void mpc_costate_funnel(mpc_search *search, int32_t count, int32_t steps);

/* mpc_costate_dual.c: evaluate the dual `which` at its multipliers */
void mpc_costate_dual_at(mpc_state *state, int32_t which);

/* mpc_costate_aim.c */
void mpc_costate_aim(mpc_state *state);

/* mpc_costate_path.c: on or off at least cost; the shares of the seconds ahead in x; returns the
 * least of the Lagrangian's stages */
mpc_real mpc_costate_choose(mpc_state *state);

#endif
