/* Functions that the files of the costate method share. */
#ifndef MPC_COSTATE_PARTS_H
#define MPC_COSTATE_PARTS_H

#include "mpc_parts.h"
#include "mpc_real.h"

/* mpc_costate_program.c: all of it but W; that, by what the search begins with */
void mpc_costate_program_fill(mpc_state *state);
void mpc_costate_smooth(mpc_state *state);

/* mpc_costate_stage.c: all stages minimised with the envelope of f, which is found there too */
void mpc_costate_minimise(mpc_state *state, int32_t which);
mpc_real mpc_costate_shared_fuel(mpc_real power_w);

/* mpc_costate_exact.c: one with f itself */
void mpc_costate_minimise_exactly(mpc_stage *stage, int32_t which);

/* mpc_costate_funnel.c: prices of the first terms, in `price`; MPC_NO_PRICE has to be there before */
#define MPC_NO_PRICE (REAL(2.0) * UNLIMITED)
void mpc_costate_funnel(mpc_search *search, int32_t count, int32_t steps);

/* mpc_costate_scan.c: multipliers of the limits of the terms 1 to MPC_STAGES in `stretch`, which are
 * then the stretches between those that are met, up to `met`, each `at` its last term, in `jump` */
void mpc_costate_scan(mpc_search *search);

/* mpc_costate_dual.c: evaluate the dual `which` at its multipliers: the costates that follow from them,
 * with all stages minimised and the terms that no stage has; then the on-shares, where they lead, and
 * the value */
void mpc_costate_price(mpc_state *state, int32_t which);
void mpc_costate_share(mpc_state *state, int32_t which);

/* mpc_costate_aim.c: multipliers on the way to the aim, into the dual `tried` */
void mpc_costate_try(mpc_state *state, int32_t tried);

/* mpc_costate_path.c: on or off at least cost; the shares of the seconds ahead in x; returns the
 * least of the Lagrangian's stages */
mpc_real mpc_costate_choose(mpc_state *state);

#endif
