
/* For verification only, never part of a generated controller: reads the quadratic program out of
 * its memory. It calls the functions that solve it: for the matrix it multiplies unit vectors, for
 * the bounds it clips values far beyond them, and so recovers the program that is solved.
 */
#define FAR REAL(1.0e36) /* far beyond the value that means no bound */

/* Entries of the matrix, (stages, rows, variables): for the stage itself and the one before. */
void reader_matrix(const mpc_state *state, mpc_real *here, mpc_real *before)
{
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        for (int32_t i = 0; i < MPC_VARS; i++) {
            mpc_real unit[MPC_VARS] = {REAL(0.0)};
            mpc_real value[MPC_ROWS];
            unit[i] = REAL(1.0);
            rows_multiply(&state->stage[k], unit, nothing, value);
            for (int32_t r = 0; r < MPC_ROWS; r++) {
                here[(((k * MPC_ROWS) + r) * MPC_VARS) + i] = value[r];
            }
            rows_multiply(&state->stage[k], nothing, unit, value);
            for (int32_t r = 0; r < MPC_ROWS; r++) {
                before[(((k * MPC_ROWS) + r) * MPC_VARS) + i] = value[r];
            }
        }
    }
}

/* Values of all rows of a stage after clipping with this dual. */
static void reader_clip(const mpc_stage *stage, mpc_real dual, mpc_real *bound)
{
    mpc_stage probe = *stage;
    for (int32_t i = 0; i < MPC_VARS; i++) {
        probe.work[i] = REAL(0.0);
    }
    for (int32_t r = 0; r < MPC_ROWS; r++) {
        probe.z[r] = REAL(0.0);
        probe.y[r] = dual;
    }
    rows_update_z_y(&probe, nothing);
    for (int32_t r = 0; r < MPC_ROWS; r++) {
        bound[r] = probe.z[r];
    }
}

/* Bounds and row scales, (stages, rows). */
void reader_rows(const mpc_state *state, mpc_real *low, mpc_real *high, mpc_real *scale)
{
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        reader_clip(&state->stage[k], -FAR, &low[k * MPC_ROWS]);
        reader_clip(&state->stage[k], FAR, &high[k * MPC_ROWS]);
        for (int32_t r = 0; r < MPC_ROWS; r++) {
            scale[(k * MPC_ROWS) + r] = state->stage[k].row[r];
        }
    }
}

/* Cost, its diagonal curvature and column scales, (stages, variables). */
void reader_columns(const mpc_state *state, mpc_real *gradient, mpc_real *hessian, mpc_real *scale)
{
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        const mpc_stage *const stage = &state->stage[k];
        for (int32_t i = 0; i < MPC_VARS; i++) {
            gradient[(k * MPC_VARS) + i] = stage->q[i];
            hessian[(k * MPC_VARS) + i] = stage->hessian[i];
            scale[(k * MPC_VARS) + i] = stage->column[i];
        }
    }
}
