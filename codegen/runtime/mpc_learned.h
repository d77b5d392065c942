/* The fuel curve in use: of the model, or where MPC_LEARNING is 1 as it is learned on the road. */
#ifndef MPC_LEARNED_H
#define MPC_LEARNED_H

#include "mpc_model.h"
#include "mpc_state.h"

#if MPC_LEARNING
#define FUEL_SLOPE(i) (state->learned.slope[i])
#define FUEL_INTERCEPT(i) (state->learned.intercept[i])

/* Learn from the second that has passed, if the engine was on. */
void mpc_learned_take(mpc_state *state);

/* Make the curve of what is known now. */
void mpc_learned_curve(mpc_state *state);

/* Whether the memory is one that mpc_learned_take can leave. */
int32_t mpc_learned_check(const mpc_state *state);
#elif !MPC_COSTATE
#define FUEL_SLOPE(i) (state->cal.fuel_scale * mpc_par.fuel_slope[i])
#define FUEL_INTERCEPT(i) (state->cal.fuel_scale * mpc_par.fuel_intercept[i])
#else
/* another curve */
#endif

#endif
