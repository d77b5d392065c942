/* Values of the quadratic program: from road, state and linearisation point to solver units.
 *
 * min  sum_k h_k [alpha(T^) F_k + alpha'(T^) F^ T_k] + price * slack   over the rows of a stage,
 *
 * T_k being the mean coolant temperature of stage k. Scaling: columns by unit and duration, rows
 * to unit norm, cost so that its largest fuel entry is 1. 
 */
#include "mpc_constants.h"
#include "mpc_learned.h"
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"
#include "mpc_rows_values.h"

static void scale_cost(mpc_state *state)
{
    mpc_real most = LEAST_COST;
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        const mpc_stage *const stage = &state->stage[k];
        most = real_max(stage->q[MPC_VAR_FUEL] * stage->column[MPC_VAR_FUEL], most);
    }
    state->cost = REAL(1.0) / most;
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        mpc_stage *const stage = &state->stage[k];
        for (int32_t i = 0; i < MPC_VARS; i++) {
            stage->q[i] *= stage->column[i] * state->cost;
        }
    }
    mpc_stage *const last = &state->stage[MPC_STAGES - 1];
    const mpc_real curvature = REAL(2.0) * mpc_par.soc_penalty_g * state->cost
                               * last->column[MPC_VAR_SOC];
    last->hessian[MPC_VAR_SOC] = curvature * last->column[MPC_VAR_SOC];
    last->q[MPC_VAR_SOC] += curvature * (state->origin_soc - mpc_par.soc_target);
}

void mpc_qp_update(mpc_state *state)
{
    mpc_stage_sums sums = {REAL(0.0)};
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        mpc_stage *const stage = &state->stage[k];
        for (int32_t i = 0; i < MPC_VARS; i++) {
            stage->q[i] = REAL(0.0);
        }
        rows_scale(stage);
        rows_fill(state, k, &sums);
    }
    scale_cost(state);
}

/* Slack of the relaxed inequalities at the first stage, relative:
 * (|F - F_pwa| LHV + |G - G_pwa|) / max(|F| LHV + |G|, 1 kW); x in SI units. */
mpc_real mpc_qp_relaxation_gap(const mpc_state *state)
{
    const mpc_stage *const stage = &state->stage[0];
    const mpc_real on = stage->x[MPC_VAR_ON];
    const mpc_real p_eng_w = stage->x[MPC_VAR_P_ENG];
    const mpc_real fuel = stage->x[MPC_VAR_FUEL];
    const mpc_real internal_w = stage->x[MPC_VAR_INTERNAL];
    const mpc_real least_g_per_s = least_fuel(state, p_eng_w, on);
    const mpc_stage_road *const road = &stage->road;
    const mpc_real bat_w = ((on * road->free_net_w) + (road->net_w - road->free_net_w)) - p_eng_w;
    mpc_real least_w = (mpc_par.battery_slope[0] * bat_w) + (mpc_par.battery_intercept[0] * on);
    for (int32_t j = 1; j < MPC_BATTERY_PIECES; j++) {
        least_w = real_max(least_w, (mpc_par.battery_slope[j] * bat_w)
                                        + (mpc_par.battery_intercept[j] * on));
    }
    least_w += (REAL(1.0) - on) * road->free_internal_off_w;
    const mpc_real slack_w = (REAL_ABS(fuel - least_g_per_s) * mpc_par.lhv_j_per_g)
                             + REAL_ABS(internal_w - least_w);
    const mpc_real size_w = (REAL_ABS(fuel) * mpc_par.lhv_j_per_g) + REAL_ABS(internal_w);
    return slack_w / real_max(size_w, LEAST_SIZE_W);
}
