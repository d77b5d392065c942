/* The algorithm: operator splitting (ADMM) with a fixed number of iterations, the method of OSQP
 * (Stellato, Banjac, Goulart, Bemporad, Boyd 2020) with a constant step size.
 *
 * min 1/2 x'Px + q'x  s.t.  low <= Ax <= high. Each iteration solves, with R = diag(rho) and the
 * proximal weight s,
 *
 *     (P + s I + A'RA) t = s x - q + A'(Rz - y)
 *     r <- a At + (1 - a) z,  x <- a t + (1 - a) x
 *     z <- clip(r + y / rho, low, high),  y <- y + rho (r - z)
 *
 * OSQP solves the same equations as a larger, indefinite system by a general sparse method. Here
 * the stages couple only through SOC and coolant temperature, so the matrix is block tridiagonal
 * and is factorised stage by stage, L D L'; the entries of a stage's factor were found when this
 * code was generated.
 */
#include <stddef.h>

#include "mpc_rows_admm.h"

/* Values before the first stage: 0, like all static variables. */
static const mpc_real nothing[MPC_VARS];

/* All memory of this algorithm is in the state: there is nothing to claim. */
void mpc_solver_claim(const mpc_state *state) { (void)state; }

static const mpc_stage *before(const mpc_state *state, int32_t k)
{
    return (k > 0) ? &state->stage[k - 1] : NULL;
}

static const mpc_stage *after(const mpc_state *state, int32_t k)
{
    return (k < (MPC_STAGES - 1)) ? &state->stage[k + 1] : NULL;
}

void mpc_solver_start(mpc_state *state)
{
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        mpc_stage *const stage = &state->stage[k];
        rows_multiply(stage, stage->x, (k > 0) ? state->stage[k - 1].x : nothing, stage->z);
        rows_factorise(stage, before(state, k), after(state, k));
    }
}

/* t, in `work`: the solution of the linear system. */
static void solve_linear_system(mpc_state *state)
{
    mpc_real unused[MPC_VARS];
    for (int32_t i = 0; i < MPC_VARS; i++) {
        unused[i] = REAL(0.0);
    }
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        rows_right_hand_side(&state->stage[k], (k > 0) ? state->stage[k - 1].work : unused);
    }
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        rows_substitute_forward(&state->stage[k], before(state, k));
    }
    for (int32_t k = MPC_STAGES - 1; k >= 0; k--) {
        rows_substitute_backward(&state->stage[k], after(state, k));
    }
}

static void update_x(mpc_stage *stage)
{
    for (int32_t i = 0; i < MPC_VARS; i++) {
        stage->x[i] = relaxed(stage->work[i], stage->x[i]);
    }
}

int32_t mpc_solver_iterate(mpc_state *state, int32_t count)
{
    for (int32_t n = 0; n < count; n++) {
        solve_linear_system(state);
        for (int32_t k = 0; k < MPC_STAGES; k++) {
            update_x(&state->stage[k]);
            rows_update_z_y(&state->stage[k], (k > 0) ? state->stage[k - 1].work : nothing);
        }
    }
    return 1;
}
