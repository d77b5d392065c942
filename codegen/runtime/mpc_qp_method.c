/* The QP as the method of planning: its values, the algorithm, and the plan in SI units. */
#include "mpc_constants.h"
#include "mpc_learned.h"
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"

void mpc_method_claim(const mpc_state *state) { mpc_solver_claim(state); }

/* A departure that is interrupted has its iterate in solver units, for which `cost` is needed. */
int32_t mpc_method_check(const mpc_state *state)
{
    return (state->phase == MPC_PHASE_DEPARTING)
               ? within(state->cost, LEAST_COST, REAL(1.0) / LEAST_COST)
               : 1;
}

static void to_solver_units(mpc_state *state)
{
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        mpc_stage *const stage = &state->stage[k];
        for (int32_t i = 0; i < MPC_VARS; i++) {
            stage->x[i] /= stage->column[i];
        }
        for (int32_t i = 0; i < MPC_ROWS; i++) {
            stage->y[i] *= state->cost / stage->row[i];
        }
    }
}

static void to_si_units(mpc_state *state)
{
    const mpc_real price = REAL(1.0) / state->cost;
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        mpc_stage *const stage = &state->stage[k];
        for (int32_t i = 0; i < MPC_VARS; i++) {
            stage->x[i] *= stage->column[i];
        }
        for (int32_t i = 0; i < MPC_ROWS; i++) {
            stage->y[i] *= stage->row[i] * price;
        }
    }
}

void mpc_method_start(mpc_state *state)
{
#if MPC_LEARNING
    mpc_learned_curve(state);
#endif
    mpc_qp_update(state);
    to_solver_units(state);
    mpc_solver_start(state);
}

int32_t mpc_method_iterate(mpc_state *state, int32_t count)
{
    return mpc_solver_iterate(state, count);
}

int32_t mpc_method_finish(mpc_state *state, int32_t solved)
{
    const int32_t usable = solved & mpc_iterate_usable(state);
    to_si_units(state);
    return usable;
}

mpc_real mpc_method_plan(const mpc_state *state, mpc_real *on_share, mpc_real *p_eng_w)
{
    for (int32_t k = 0; k < MPC_SHORT; k++) {
        on_share[k] = state->stage[k].x[MPC_VAR_ON];
        p_eng_w[k] = state->stage[k].x[MPC_VAR_P_ENG];
    }
    const mpc_prices prices = mpc_polish_prices(state);
    const mpc_real room_w = mpc_full_battery_w(state, &prices);
    /* worked out whether it runs or not, so that every second takes the same instructions */
    const mpc_real stay_share = real_min(state->cal.on_threshold, STAY_SHARE);
    const mpc_real share = real_min(real_max(on_share[0], stay_share), REAL(1.0));
    const mpc_real own_w = mpc_polish_power_w(state, &prices, 0, p_eng_w[0] / share);
    const mpc_real polished_w = share * real_min(own_w, room_w);
    p_eng_w[0] = pick((on_share[0] >= stay_share) ? 1 : 0, polished_w, p_eng_w[0]);
#if MPC_STARTS
    mpc_going second[MPC_SHORT];
    for (int32_t k = 0; k < MPC_SHORT; k++) {
        second[k] = mpc_polish_going(state, &prices, k);
    }
#else
    const mpc_going second[1] = {
        {mpc_polish_power_w(state, &prices, 0, REAL(0.0)), REAL(0.0), REAL(0.0)}};
#endif
    return mpc_coming_least_w(state, &prices, on_share, second, room_w);
}

void mpc_method_report(const mpc_state *state, mpc_out *out)
{
    out->relaxation_gap = mpc_qp_relaxation_gap(state);
}

void mpc_plan(const mpc_state *state, mpc_real *x, mpc_real *duals)
{
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        const mpc_stage *const stage = &state->stage[k];
        const int32_t in_si = (state->phase == MPC_PHASE_DEPARTING) ? 0 : 1;
        for (int32_t i = 0; i < MPC_VARS; i++) {
            const mpc_real unit = (in_si != 0) ? REAL(1.0) : stage->column[i];
            x[(k * MPC_VARS) + i] = stage->x[i] * unit;
        }
        x[(k * MPC_VARS) + MPC_VAR_SOC] += state->origin_soc;
        x[(k * MPC_VARS) + MPC_VAR_T_CL] += state->origin_t_cl_degc;
        for (int32_t i = 0; i < MPC_ROWS; i++) {
            const mpc_real unit = (in_si != 0) ? REAL(1.0) : (stage->row[i] / state->cost);
            duals[(k * MPC_ROWS) + i] = stage->y[i] * unit;
        }
    }
}
