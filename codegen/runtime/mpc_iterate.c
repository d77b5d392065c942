/* The iterate, primal and dual: its start, its units, whether it may be used. The same for every
 * algorithm. */
#include "mpc_constants.h"
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"

#define LARGEST_FINITE REAL(1.0e30)

/* A cold start: all variables 0, SOC and coolant temperature too; of the multipliers that of SOC is
 * a guess where it is a price. */
void mpc_iterate_clear(mpc_state *state)
{
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        for (int32_t i = 0; i < MPC_VARS; i++) {
            state->stage[k].x[i] = REAL(0.0);
        }
        for (int32_t i = 0; i < MPC_ROWS; i++) {
            state->stage[k].y[i] = REAL(0.0);
        }
#if MPC_COSTATE
        state->stage[k].y[MPC_ROW_CHARGE] = state->cal.fuel_scale * mpc_par.usual_charge_g;
#endif
    }
    state->origin_soc = REAL(0.0);
    state->origin_t_cl_degc = REAL(0.0);
}

/* Short stages move up by some seconds (in equal time); the last keeps its values; long stages
 * keep their place. So does the point that they are expanded about. What a limit of the coolant
 * costs in a second is that second's own: it is not there twice. */
void mpc_iterate_shift(mpc_state *state, int32_t by)
{
    for (int32_t k = 0; k < (MPC_SHORT - 1); k++) {
        const int32_t later = k + by;
        const int32_t from = (later < MPC_SHORT) ? later : (MPC_SHORT - 1);
        for (int32_t i = 0; i < MPC_VARS; i++) {
            state->stage[k].x[i] = state->stage[from].x[i];
        }
        for (int32_t i = 0; i < MPC_ROWS; i++) {
            state->stage[k].y[i] = state->stage[from].y[i];
        }
        mpc_stage_road *const road = &state->stage[k].road;
        const mpc_stage_road *const of = &state->stage[from].road;
        road->about_t_cl_end_degc = of->about_t_cl_end_degc;
        road->about_fuel_g_per_s = of->about_fuel_g_per_s;
        road->about_p_eng_w = of->about_p_eng_w;
#if MPC_COSTATE
        mpc_real *const heat = &state->stage[k].y[MPC_ROW_HEAT];
        *heat = (later < MPC_SHORT) ? *heat : REAL(0.0);
#endif
    }
#if MPC_COSTATE
    mpc_real *const last = &state->stage[MPC_SHORT - 1].y[MPC_ROW_HEAT];
    *last = (by == 0) ? *last : REAL(0.0);
#endif
}

/* False for NaN: 0 times that, or times infinity, is not 0. */
static int32_t all_below(const mpc_state *state, mpc_real limit)
{
    mpc_real most = REAL(0.0);
    mpc_real nil = REAL(0.0);
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        const mpc_stage *const stage = &state->stage[k];
        for (int32_t i = 0; i < MPC_VARS; i++) {
            most = real_max(REAL_ABS(stage->x[i]), most);
            nil += REAL(0.0) * stage->x[i];
        }
        for (int32_t i = 0; i < MPC_ROWS; i++) {
            most = real_max(REAL_ABS(stage->y[i]), most);
            nil += REAL(0.0) * stage->y[i];
        }
    }
    return within(nil, REAL(0.0), REAL(0.0)) & ((most < limit) ? 1 : 0);
}

/* Remember the iterate, in SI units, in case the solve that starts from it fails. */
void mpc_iterate_keep(mpc_state *state)
{
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        for (int32_t i = 0; i < MPC_VARS; i++) {
            state->kept[k].x[i] = state->stage[k].x[i];
        }
        for (int32_t i = 0; i < MPC_ROWS; i++) {
            state->kept[k].y[i] = state->stage[k].y[i];
        }
    }
}

/* Restore the kept iterate; returns whether all of it is finite. */
int32_t mpc_iterate_restore(mpc_state *state)
{
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        for (int32_t i = 0; i < MPC_VARS; i++) {
            state->stage[k].x[i] = state->kept[k].x[i];
        }
        for (int32_t i = 0; i < MPC_ROWS; i++) {
            state->stage[k].y[i] = state->kept[k].y[i];
        }
    }
    return all_below(state, LARGEST_FINITE);
}

/* Solved or stopped at the limit with finite, plausible numbers, in units of the method. */
int32_t mpc_iterate_usable(const mpc_state *state) { return all_below(state, LARGEST_PLAUSIBLE); }
