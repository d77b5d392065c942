
/* For verification only, never part of a generated controller: values of a quadratic program. */

/* Make the values of a second, expanded about a plan: x in SI units, (stages, variables). Returns
 * the scale of the cost, in units of the solver per g. */
mpc_real reader_prepare(mpc_state *state, const mpc_in *in, const mpc_real *x)
{
    mpc_init(state);
    int32_t elapsed = 0;
    (void)mpc_check_measured(&state->watch, &state->cal, in, &elapsed);
    mpc_stages_take(state, in);
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        for (int32_t i = 0; i < MPC_VARS; i++) {
            state->stage[k].x[i] = x[(k * MPC_VARS) + i];
        }
    }
    mpc_stages_follow_plan(state);
    state->phase = MPC_PHASE_RUNNING;
    prepare(state);
    state->phase = MPC_PHASE_DEPARTING; /* from here on the iterate is in the solver's units */
    return state->cost;
}
