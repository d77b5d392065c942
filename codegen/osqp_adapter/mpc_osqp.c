/* The algorithm: OSQP in its embedded form with updates of vectors and matrices.
 *
 * OSQP's workspace is one set of static variables that point at each other. It cannot be part of
 * mpc_state and serves only one controller: the one initialised last owns it, and every solve of
 * any other fails and is flagged. Of the data that OSQP keeps between calls only the iterate of a
 * departure is used; everything else is written anew by mpc_solver_start, so that nothing, such as
 * a NaN, remains from a failed solve.
 *
 * The variables are in the order of `x`, stage by stage, the rows in that of `z`.
 */
#include <stddef.h>

#include "mpc_osqp_workspace.h"
#include "osqp.h"

#include "mpc_parts.h"
#include "mpc_rows_osqp.h"

#if OSQP_EMBEDDED_MODE != 2
#error "the matrix changes every second: OSQP must be generated with updates of matrices"
#endif
#if defined(OSQP_ENABLE_PRINTING) || defined(OSQP_ENABLE_INTERRUPT)
#error "OSQP must be generated without input and output"
#endif
#if defined(OSQP_ENABLE_PROFILING)
#error "with its clock OSQP may stop at a time limit: it must be generated without"
#endif
#if (MPC_F32 && !defined(OSQP_USE_FLOAT)) || (!MPC_F32 && defined(OSQP_USE_FLOAT))
#error "OSQP and controller were generated in different precisions"
#endif

enum {
    VARIABLES = MPC_STAGES * MPC_VARS,
    ROWS = MPC_STAGES * MPC_ROWS,
    ENTRIES = (MPC_STAGES * MPC_ENTRIES) - MPC_ENTRIES_BEFORE, /* none before the first stage */
    MOST_VALUES = VARIABLES + ENTRIES /* of the entries passed in one call */
};

static const mpc_state *owner;
static int32_t is_loaded;
static mpc_real values[MOST_VALUES];

/* The last controller initialised has the workspace. */
void mpc_solver_claim(const mpc_state *state)
{
    owner = state;
    is_loaded = 0;
}

/* Dimensions as expected; no setting that varies its work, or the problem, from step to step. */
static int32_t is_sound(void)
{
    const OSQPSettings *const settings = mpc_osqp_solver.settings;
    OSQPInt rows = 0;
    OSQPInt variables = 0;
    osqp_get_dimensions(&mpc_osqp_solver, &rows, &variables);
    return ((rows == ROWS) && (variables == VARIABLES) && (settings->scaling == 0)
            && (settings->adaptive_rho == 0) && (settings->check_termination == 0))
               ? 1
               : 0;
}

/* Hessian and matrix; OSQP factorises them at once. */
static OSQPInt load_matrices(const mpc_state *state)
{
    int32_t at = 0;
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        for (int32_t i = 0; i < MPC_VARS; i++) {
            values[at] = state->stage[k].hessian[i];
            at++;
        }
    }
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        const mpc_stage_matrix *const after = (k < (MPC_STAGES - 1)) ? &state->stage[k + 1].a
                                                                     : NULL;
        at = rows_put_columns(values, at, &state->stage[k].a, after);
    }
    return osqp_update_data_mat(&mpc_osqp_solver, values, OSQP_NULL, VARIABLES, &values[VARIABLES],
                                OSQP_NULL, ENTRIES);
}

/* Gradient and bounds. */
static OSQPInt load_vectors(const mpc_state *state)
{
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        for (int32_t i = 0; i < MPC_VARS; i++) {
            values[(k * MPC_VARS) + i] = state->stage[k].q[i];
        }
        mpc_real *const low = &values[VARIABLES + (k * MPC_ROWS)];
        rows_put_bounds(low, &low[ROWS], &state->stage[k].b);
    }
    return osqp_update_data_vec(&mpc_osqp_solver, values, &values[VARIABLES],
                                &values[VARIABLES + ROWS]);
}

static OSQPInt load_iterate(const mpc_state *state)
{
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        for (int32_t i = 0; i < MPC_VARS; i++) {
            values[(k * MPC_VARS) + i] = state->stage[k].x[i];
        }
        for (int32_t i = 0; i < MPC_ROWS; i++) {
            values[VARIABLES + (k * MPC_ROWS) + i] = state->stage[k].y[i];
        }
    }
    return osqp_warm_start(&mpc_osqp_solver, values, &values[VARIABLES]);
}

void mpc_solver_start(mpc_state *state)
{
    is_loaded = 0;
    if ((owner == state) && (is_sound() != 0)) {
        const OSQPInt matrices = load_matrices(state);
        const OSQPInt vectors = load_vectors(state);
        const OSQPInt iterate = load_iterate(state);
        is_loaded = ((matrices == 0) && (vectors == 0) && (iterate == 0)) ? 1 : 0;
    }
}

/* OSQP returns 0 after an infeasible problem too, with 2e9 for every variable. */
static int32_t has_result(void)
{
    const OSQPInt status = mpc_osqp_solver.info->status_val;
    return ((status == (OSQPInt)OSQP_SOLVED) || (status == (OSQPInt)OSQP_SOLVED_INACCURATE)
            || (status == (OSQPInt)OSQP_MAX_ITER_REACHED))
               ? 1
               : 0;
}

int32_t mpc_solver_iterate(mpc_state *state, int32_t count)
{
    int32_t solved = 0;
    if ((owner == state) && (is_loaded != 0)) {
        mpc_osqp_solver.settings->max_iter = count;
        solved = ((osqp_solve(&mpc_osqp_solver) == 0) && (has_result() != 0)) ? 1 : 0;
    }
    if (solved != 0) {
        const OSQPSolution *const found = mpc_osqp_solver.solution;
        for (int32_t k = 0; k < MPC_STAGES; k++) {
            for (int32_t i = 0; i < MPC_VARS; i++) {
                state->stage[k].x[i] = found->x[(k * MPC_VARS) + i];
            }
            for (int32_t i = 0; i < MPC_ROWS; i++) {
                state->stage[k].y[i] = found->y[(k * MPC_ROWS) + i];
            }
        }
    }
    return solved;
}
