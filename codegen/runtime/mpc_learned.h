/* The fuel curve in use: of the model, or where MPC_LEARNING is 1 as it is learned on the road. */
#ifndef MPC_LEARNED_H
#define MPC_LEARNED_H

#include "mpc_model.h"
#include "mpc_real.h"
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
#elif MPC_COSTATE
/* the envelope of the engine's line, in rows of four: slope, end, begin, intercept */
#define FUEL_PIECES MPC_SHARED_PIECES
#define FUEL_SLOPE(i) (state->cal.fuel_scale * mpc_par.shared[4 * (i)])
#define FUEL_INTERCEPT(i) (state->cal.fuel_scale * mpc_par.shared[(4 * (i)) + 3])
#else
#define FUEL_SLOPE(i) (state->cal.fuel_scale * mpc_par.fuel_slope[i])
#define FUEL_INTERCEPT(i) (state->cal.fuel_scale * mpc_par.fuel_intercept[i])
#endif
#if !MPC_COSTATE
#define FUEL_PIECES MPC_FUEL_PIECES
#endif

/* Least fuel rate of the hot engine at a mean power and an on-share: the curve is convex. */
static inline mpc_real least_fuel(const mpc_state *state, mpc_real p_eng_w, mpc_real on)
{
    mpc_real least = (FUEL_SLOPE(0) * p_eng_w) + (FUEL_INTERCEPT(0) * on);
    for (int32_t i = 1; i < FUEL_PIECES; i++) {
        least = real_max(least, (FUEL_SLOPE(i) * p_eng_w) + (FUEL_INTERCEPT(i) * on));
    }
    return least;
}

#endif
