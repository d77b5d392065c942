/* The solver: OSQP in its embedded form with updates of vectors and matrices.
 *
 * OSQP's workspace is one set of static variables that point at each other. It cannot be part of
 * mpc_state and does not serve two controllers: the one initialised last owns it, and of any other
 * every solve fails, which its caller is told. Of what OSQP keeps between calls only the iterate of
 * a departure counts; everything else is written anew by solver_start, so that nothing of a solve
 * gone wrong, a NaN for one, is left.
 *
 * The variables are in the order of `x`, stage by stage, the rows in that of `z`.
 */
#include <stddef.h>

#include "mpc_osqp_workspace.h"
#include "osqp.h"

#include "mpc_parts.h"
#include "mpc_real.h"

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

#define UNLIMITED REAL(1.0e30)

enum {
    VARIABLES = MPC_STAGES * MPC_VARS,
    ROWS = MPC_STAGES * MPC_ROWS,
    /* of the matrix: the rows of a stage with their entries, but for two before the first stage */
    ENTRIES = (MPC_STAGES * ((3 * (MPC_FUEL_PIECES + MPC_BATTERY_PIECES)) + 18)) - 2,
    MOST_VALUES = VARIABLES + ENTRIES /* of what is handed over in one call */
};

static const mpc_state *owner;
static int32_t is_loaded;
static real_t values[MOST_VALUES];

/* The last controller initialised has the workspace. */
void solver_claim(const mpc_state *state)
{
    owner = state;
    is_loaded = 0;
}

/* Dimensions as expected; nothing that makes its work, or the problem, differ from step to step. */
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

static int32_t put(int32_t at, real_t value)
{
    values[at] = value;
    return at + 1;
}

/* Columns of slack, on, internal, fuel and p_eng of a stage, each from the first row down. */
static int32_t put_rates(int32_t first, const stage_matrix *a)
{
    int32_t at = put(first, a->t_min[1]);
    at = put(at, a->t_max[1]);
    at = put(at, REAL(1.0));
    for (int32_t i = 0; i < MPC_FUEL_PIECES; i++) {
        at = put(at, a->fuel[i][2]);
    }
    for (int32_t j = 0; j < MPC_BATTERY_PIECES; j++) {
        at = put(at, a->battery[j][2]);
    }
    at = put(at, a->p_max[1]);
    at = put(at, a->p_min[1]);
    at = put(at, REAL(1.0));
    at = put(at, a->soc[2]);
    for (int32_t j = 0; j < MPC_BATTERY_PIECES; j++) {
        at = put(at, a->battery[j][0]);
    }
    at = put(at, a->t_cl[3]);
    for (int32_t i = 0; i < MPC_FUEL_PIECES; i++) {
        at = put(at, a->fuel[i][0]);
    }
    at = put(at, a->t_cl[2]);
    for (int32_t i = 0; i < MPC_FUEL_PIECES; i++) {
        at = put(at, a->fuel[i][1]);
    }
    for (int32_t j = 0; j < MPC_BATTERY_PIECES; j++) {
        at = put(at, a->battery[j][1]);
    }
    at = put(at, a->p_max[0]);
    at = put(at, a->p_min[0]);
    return at;
}

/* Columns of soc and t_cl, which stand in rows of the stage after too. */
static int32_t put_states(int32_t first, const stage_matrix *a, const stage_matrix *after)
{
    int32_t at = put(first, a->soc[0]);
    at = put(at, REAL(1.0));
    if (after != NULL) {
        at = put(at, after->soc[1]);
    }
    at = put(at, a->t_cl[0]);
    at = put(at, a->t_min[0]);
    at = put(at, a->t_max[0]);
    if (after != NULL) {
        at = put(at, after->t_cl[1]);
    }
    return at;
}

/* Hessian and matrix; OSQP factorises them at once. */
static OSQPInt load_matrices(const mpc_state *state)
{
    int32_t at = 0;
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        for (int32_t i = 0; i < MPC_VARS; i++) {
            at = put(at, state->stage[k].hessian[i]);
        }
    }
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        const stage_matrix *const after = (k < (MPC_STAGES - 1)) ? &state->stage[k + 1].a : NULL;
        at = put_rates(at, &state->stage[k].a);
        at = put_states(at, &state->stage[k].a, after);
    }
    return osqp_update_data_mat(&mpc_osqp_solver, values, OSQP_NULL, VARIABLES, &values[VARIABLES],
                                OSQP_NULL, ENTRIES);
}

static void put_bounds(int32_t row, real_t low, real_t high)
{
    values[VARIABLES + row] = low;
    values[VARIABLES + ROWS + row] = high;
}

/* Gradient and bounds. */
static OSQPInt load_vectors(const mpc_state *state)
{
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        const stage_bounds *const b = &state->stage[k].b;
        const int32_t first = k * MPC_ROWS;
        for (int32_t i = 0; i < MPC_VARS; i++) {
            values[(k * MPC_VARS) + i] = state->stage[k].q[i];
        }
        put_bounds(first + ROW_SOC, REAL(0.0), REAL(0.0));
        put_bounds(first + ROW_T_CL, b->t_cl, b->t_cl);
        for (int32_t i = 0; i < MPC_FUEL_PIECES; i++) {
            put_bounds(first + ROW_FUEL + i, REAL(0.0), UNLIMITED);
        }
        for (int32_t j = 0; j < MPC_BATTERY_PIECES; j++) {
            put_bounds(first + ROW_BATTERY + j, b->battery_low[j], UNLIMITED);
        }
        put_bounds(first + ROW_P_MAX, -UNLIMITED, REAL(0.0));
        put_bounds(first + ROW_P_MIN, b->p_min_low, UNLIMITED);
        put_bounds(first + ROW_BOX_SOC, b->soc_low, b->soc_high);
        put_bounds(first + ROW_BOX_ON, b->on_low, b->on_high);
        put_bounds(first + ROW_T_MIN, b->t_min_low, UNLIMITED);
        put_bounds(first + ROW_T_MAX, -UNLIMITED, b->t_max_high);
        put_bounds(first + ROW_SLACK, REAL(0.0), UNLIMITED);
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

void solver_start(mpc_state *state)
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

int32_t solver_iterate(mpc_state *state, int32_t count)
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
