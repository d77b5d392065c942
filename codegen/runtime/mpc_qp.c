/* Values of the quadratic program: from road, state and linearisation point to solver units.
 *
 * min  sum_k h_k [alpha(T^) F_k + alpha'(T^) F^ T_k] + price * slack   over the rows of a stage,
 *
 * T_k being the mean coolant temperature of stage k. Scaling: columns by unit and duration, rows
 * to unit norm, cost so that its largest fuel entry is 1. 
 */
#include "mpc_battery_side.h"
#include "mpc_constants.h"
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"

/* Preview to stages: seconds first, then the classes of each block; what is past is masked. */
void qp_road(mpc_state *state, const mpc_in *in)
{
    for (int32_t k = 0; k < MPC_SHORT; k++) {
        mpc_stage *const stage = &state->stage[k];
        const int32_t seen = (k < in->short_count) ? 1 : 0;
        stage->duration_s = (seen != 0) ? REAL(1.0) : REAL(0.0);
        stage->net_w = (seen != 0) ? battery_side_w(in->short_demand_w[k]) : REAL(0.0);
        stage->speed_mps = (seen != 0) ? in->short_speed_mps[k] : REAL(0.0);
        stage->internal_off_w = map_planned_internal_w(stage->net_w);
    }
    for (int32_t k = 0; k < MPC_LONG; k++) {
        mpc_stage *const stage = &state->stage[MPC_SHORT + k];
        stage->duration_s = in->long_duration_s[k];
        stage->net_w = in->long_net_w[k];
        stage->speed_mps = in->long_speed_mps[k];
        stage->internal_off_w = in->long_internal_off_w[k];
    }
}

/* Count SOC and coolant temperature from a newly measured state. */
void qp_move_origin(mpc_state *state, real_t soc, real_t t_cl_degc)
{
    const real_t soc_step = state->origin_soc - soc;
    const real_t t_cl_step = state->origin_t_degc - t_cl_degc;
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        state->stage[k].x[VAR_SOC] += soc_step;
        state->stage[k].x[VAR_T_CL] += t_cl_step;
    }
    state->origin_soc = soc;
    state->origin_t_degc = t_cl_degc;
}

void qp_linearise_cold(mpc_state *state)
{
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        state->stage[k].about_t_degc = state->origin_t_degc;
        state->stage[k].about_fuel_g_per_s = DEPARTURE_FUEL_G_PER_S;
        state->stage[k].about_p_eng_w = DEPARTURE_P_ENG_W;
        state->stage[k].about_start_degc = state->origin_t_degc;
        state->stage[k].about_end_degc = state->origin_t_degc;
    }
}

/* The last plan, in SI units. alpha is taken at the mean temperature of a stage's own ends, for
 * demand classes at that of their block's: the class that is driven first in the plan is driven all
 * over the block on the road. */
void qp_linearise_about_plan(mpc_state *state)
{
    real_t start = real_clip(state->origin_t_degc, COLDEST_DEGC, HOTTEST_DEGC);
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        mpc_stage *const stage = &state->stage[k];
        stage->about_start_degc = start;
        stage->about_end_degc = real_clip(state->origin_t_degc + stage->x[VAR_T_CL],
                                          COLDEST_DEGC, HOTTEST_DEGC);
        stage->about_t_degc = REAL(0.5) * (start + stage->about_end_degc);
        stage->about_fuel_g_per_s = real_max(stage->x[VAR_FUEL], REAL(0.0));
        stage->about_p_eng_w = real_max(stage->x[VAR_P_ENG], REAL(0.0));
        start = stage->about_end_degc;
    }
    for (int32_t k = MPC_SHORT; k < MPC_STAGES; k += MPC_CLASSES) {
        mpc_stage *const block = &state->stage[k];
        const real_t mean =
            REAL(0.5) * (block[0].about_start_degc + block[MPC_CLASSES - 1].about_end_degc);
        for (int32_t i = 0; i < MPC_CLASSES; i++) {
            block[i].about_t_degc = mean;
        }
    }
}

/* Scale a row to unit norm; returns the factor. */
static real_t normalise(real_t *entries, int32_t count)
{
    real_t square = REAL(0.0);
    for (int32_t i = 0; i < count; i++) {
        square += entries[i] * entries[i];
    }
    const real_t factor = REAL(1.0) / REAL_SQRT(square);
    for (int32_t i = 0; i < count; i++) {
        entries[i] *= factor;
    }
    return factor;
}

static void fill_columns(mpc_stage *stage)
{
    const real_t stretch = MPC_STRETCH(real_max(stage->duration_s, SHORTEST_SCALE_S));
    stage->column[VAR_SLACK] = mpc_par.unit_t_k;
    stage->column[VAR_ON] = stretch;
    stage->column[VAR_INTERNAL] = mpc_par.unit_power_w * stretch;
    stage->column[VAR_FUEL] = mpc_par.unit_fuel_g_per_s * stretch;
    stage->column[VAR_P_ENG] = mpc_par.unit_power_w * stretch;
    stage->column[VAR_SOC] = mpc_par.unit_soc;
    stage->column[VAR_T_CL] = mpc_par.unit_t_k;
}

/* F - a_i E - b_i sigma >= 0 */
static void fill_fuel_rows(mpc_stage *stage)
{
    for (int32_t i = 0; i < MPC_FUEL_PIECES; i++) {
        real_t *const entries = stage->a.fuel[i];
        entries[0] = stage->column[VAR_FUEL];
        entries[1] = -mpc_par.fuel_slope[i] * stage->column[VAR_P_ENG];
        entries[2] = -mpc_par.fuel_intercept[i] * stage->column[VAR_ON];
        stage->row[ROW_FUEL + i] = normalise(entries, 3);
    }
}

/* G + c_j E - (c_j P0 + d_j - l(P0)) sigma >= l(P0) */
static void fill_battery_rows(mpc_stage *stage)
{
    const real_t off_w = stage->internal_off_w;
    for (int32_t j = 0; j < MPC_BATTERY_PIECES; j++) {
        const real_t slope = mpc_par.battery_slope[j];
        const real_t on_w = (stage->net_w * slope) + mpc_par.battery_intercept[j];
        real_t *const entries = stage->a.battery[j];
        entries[0] = stage->column[VAR_INTERNAL];
        entries[1] = slope * stage->column[VAR_P_ENG];
        entries[2] = (off_w - on_w) * stage->column[VAR_ON];
        const real_t factor = normalise(entries, 3);
        stage->row[ROW_BATTERY + j] = factor;
        stage->b.battery_low[j] = off_w * factor;
    }
}

/* sigma P_min <= E <= sigma min(P_max, P0 + P_chg); engine on where the battery does not do. */
static void fill_engine_rows(mpc_stage *stage)
{
    const real_t most_w =
        real_min(mpc_par.engine_max_w, stage->net_w + mpc_par.battery_charge_max_w);
    const real_t missing_w = stage->net_w - mpc_par.battery_discharge_max_w;
    stage->a.p_max[0] = stage->column[VAR_P_ENG];
    stage->a.p_max[1] = -most_w * stage->column[VAR_ON];
    stage->row[ROW_P_MAX] = normalise(stage->a.p_max, 2);
    stage->a.p_min[0] = stage->column[VAR_P_ENG];
    stage->a.p_min[1] = -mpc_par.engine_min_w * stage->column[VAR_ON];
    stage->row[ROW_P_MIN] = normalise(stage->a.p_min, 2);
    stage->b.p_min_low =
        real_max(missing_w - mpc_par.engine_min_w, REAL(0.0)) * stage->row[ROW_P_MIN];
    const real_t factor = REAL(1.0) / stage->column[VAR_ON];
    stage->row[ROW_BOX_ON] = factor;
    stage->b.on_low = (missing_w > REAL(0.0)) ? (SIGMA_FORCED * factor) : REAL(0.0);
    stage->b.on_high = factor;
}

/* SOC_k - SOC_{k-1} + h G / E_bat = 0 and SOC limits that can be met. `reach` is the SOC, from the
 * origin, that charging all the way leads to before this stage; returns that after it. The first
 * stage starts at the origin: there is no SOC before it in x. */
static real_t fill_soc_rows(mpc_stage *stage, int32_t is_first, real_t origin, real_t reach)
{
    const real_t rate = stage->duration_s / mpc_par.battery_energy_j;
    const real_t strongest_w =
        real_max(stage->net_w - mpc_par.engine_max_w, -mpc_par.battery_charge_max_w);
    const real_t reached = reach - (rate * pwa_battery(strongest_w));
    stage->a.soc[0] = stage->column[VAR_SOC];
    stage->a.soc[1] = (is_first != 0) ? REAL(0.0) : -stage->column[VAR_SOC];
    stage->a.soc[2] = rate * stage->column[VAR_INTERNAL];
    stage->row[ROW_SOC] = normalise(stage->a.soc, 3);
    const real_t factor = REAL(1.0) / stage->column[VAR_SOC];
    const real_t reserve =
        (stage->duration_s > ACCURATE_STAGE_S) ? mpc_par.soc_reserve : REAL(0.0);
    const real_t low = (mpc_par.soc_min + reserve) - origin;
    stage->row[ROW_BOX_SOC] = factor;
    stage->b.soc_low = real_min(low, reached - REACH_MARGIN_SOC) * factor;
    stage->b.soc_high = (mpc_par.soc_max - origin) * factor;
    return reached;
}

/* Coolant balance with its thermostat, coolant limits, and what fuel and coolant weigh in the cost.
 * The heat is q = (1 - x) (LHV alpha F - E) - UA (T - T_amb) - Q_cabin, expanded; what it makes of
 * the coolant is expanded too. Temperatures in x count from the origin. Returns the weight of the
 * coolant temperature at each end of the stage. */
static real_t fill_coolant_rows(mpc_stage *stage, int32_t is_first, real_t origin_degc)
{
    const real_t share = REAL(1.0) - mpc_par.exhaust_share;
    const real_t heat_j_per_g = share * mpc_par.lhv_j_per_g;
    const real_t about = stage->about_t_degc;
    const real_t alpha = pwa_alpha(about);
    const real_t growth = pwa_alpha_slope(about) * stage->about_fuel_g_per_s;
    const real_t ua = mpc_par.ua0_w_per_k + (mpc_par.ua1_w_per_k_per_mps * stage->speed_mps);
    const real_t per_mean = ua - (heat_j_per_g * growth);
    const real_t start = stage->about_start_degc - origin_degc;
    const real_t ends = start + (stage->about_end_degc - origin_degc);
    const real_t heat_at_zero = (ua * (mpc_par.t_amb_degc - origin_degc))
                                - (heat_j_per_g * growth * (about - origin_degc))
                                - map_cabin_w(about);
    const real_t heat_w = (heat_j_per_g * alpha * stage->about_fuel_g_per_s)
                          - (share * stage->about_p_eng_w) + heat_at_zero
                          - (REAL(0.5) * per_mean * ends);
    const real_t open = mpc_par.thermostat_open_degc - origin_degc;
    const thermostat_end end = thermostat_step(stage->duration_s, start - open, heat_w);
    const real_t half = REAL(0.5) * end.per_heat * per_mean;
    const real_t equal =
        (end.per_heat * (heat_at_zero - heat_w)) + end.u + open - (end.per_start * start);
    stage->a.t_cl[0] = (REAL(1.0) + half) * stage->column[VAR_T_CL];
    stage->a.t_cl[1] =
        (is_first != 0) ? REAL(0.0) : ((half - end.per_start) * stage->column[VAR_T_CL]);
    stage->a.t_cl[2] = end.per_heat * share * stage->column[VAR_P_ENG];
    stage->a.t_cl[3] = -end.per_heat * heat_j_per_g * alpha * stage->column[VAR_FUEL];
    const real_t factor = normalise(stage->a.t_cl, 4);
    stage->row[ROW_T_CL] = factor;
    stage->b.t_cl = equal * factor;

    stage->a.t_min[0] = stage->column[VAR_T_CL];
    stage->a.t_min[1] = stage->column[VAR_SLACK];
    stage->row[ROW_T_MIN] = normalise(stage->a.t_min, 2);
    stage->b.t_min_low = (mpc_par.t_min_degc - origin_degc) * stage->row[ROW_T_MIN];
    stage->a.t_max[0] = stage->column[VAR_T_CL];
    stage->a.t_max[1] = -stage->column[VAR_SLACK];
    stage->row[ROW_T_MAX] = normalise(stage->a.t_max, 2);
    stage->b.t_max_high = (mpc_par.t_max_degc - origin_degc) * stage->row[ROW_T_MAX];
    stage->row[ROW_SLACK] = REAL(1.0) / stage->column[VAR_SLACK];

    stage->q[VAR_FUEL] = stage->duration_s * alpha;
    stage->q[VAR_SLACK] = mpc_par.slack_g_per_k;
    return REAL(0.5) * stage->duration_s * growth;
}

/* The last stage ends in the SOC band, or pays for its distance from the initial SOC. */
static void close_trip(mpc_stage *last, real_t origin, real_t reached)
{
    if (!(mpc_par.soc_penalty_g > REAL(0.0))) {
        const real_t low = mpc_par.terminal_soc_low - origin;
        last->b.soc_low = real_min(low, reached - REACH_MARGIN_SOC) * last->row[ROW_BOX_SOC];
        last->b.soc_high = (mpc_par.terminal_soc_high - origin) * last->row[ROW_BOX_SOC];
    }
}

static void scale_cost(mpc_state *state)
{
    real_t most = LEAST_COST;
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        const mpc_stage *const stage = &state->stage[k];
        most = real_max(stage->q[VAR_FUEL] * stage->column[VAR_FUEL], most);
    }
    state->cost = REAL(1.0) / most;
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        mpc_stage *const stage = &state->stage[k];
        for (int32_t i = 0; i < MPC_VARS; i++) {
            stage->q[i] *= stage->column[i] * state->cost;
        }
    }
    mpc_stage *const last = &state->stage[MPC_STAGES - 1];
    const real_t curvature =
        REAL(2.0) * mpc_par.soc_penalty_g * state->cost * last->column[VAR_SOC];
    last->hessian[VAR_SOC] = curvature * last->column[VAR_SOC];
    last->q[VAR_SOC] += curvature * (state->origin_soc - mpc_par.soc_init);
}

void qp_update(mpc_state *state)
{
    real_t reach = REAL(0.0);
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        mpc_stage *const stage = &state->stage[k];
        for (int32_t i = 0; i < MPC_VARS; i++) {
            stage->q[i] = REAL(0.0);
            stage->hessian[i] = mpc_par.regularisation;
        }
        stage->hessian[VAR_SOC] = REAL(0.0);
        stage->hessian[VAR_T_CL] = REAL(0.0);
        const int32_t is_first = (k == 0) ? 1 : 0;
        fill_columns(stage);
        fill_fuel_rows(stage);
        fill_battery_rows(stage);
        fill_engine_rows(stage);
        reach = fill_soc_rows(stage, is_first, state->origin_soc, reach);
        const real_t t_cl_weight = fill_coolant_rows(stage, is_first, state->origin_t_degc);
        stage->q[VAR_T_CL] += t_cl_weight;
        if (k > 0) {
            state->stage[k - 1].q[VAR_T_CL] += t_cl_weight;
        }
    }
    close_trip(&state->stage[MPC_STAGES - 1], state->origin_soc, reach);
    scale_cost(state);
}

/* Slack of the relaxed inequalities at a stage, relative:
 * (|F - F_pwa| LHV + |G - G_pwa|) / max(|F| LHV + |G|, 1 kW); x in SI units. */
real_t qp_relaxation_gap(const mpc_stage *stage)
{
    const real_t on = stage->x[VAR_ON];
    const real_t p_eng_w = stage->x[VAR_P_ENG];
    const real_t fuel = stage->x[VAR_FUEL];
    const real_t internal_w = stage->x[VAR_INTERNAL];
    real_t least_fuel = (mpc_par.fuel_slope[0] * p_eng_w) + (mpc_par.fuel_intercept[0] * on);
    for (int32_t i = 1; i < MPC_FUEL_PIECES; i++) {
        least_fuel = real_max(least_fuel, (mpc_par.fuel_slope[i] * p_eng_w)
                                              + (mpc_par.fuel_intercept[i] * on));
    }
    const real_t bat_w = (on * stage->net_w) - p_eng_w;
    real_t least_w = (mpc_par.battery_slope[0] * bat_w) + (mpc_par.battery_intercept[0] * on);
    for (int32_t j = 1; j < MPC_BATTERY_PIECES; j++) {
        least_w = real_max(least_w, (mpc_par.battery_slope[j] * bat_w)
                                        + (mpc_par.battery_intercept[j] * on));
    }
    least_w += (REAL(1.0) - on) * stage->internal_off_w;
    const real_t slack_w = (REAL_ABS(fuel - least_fuel) * mpc_par.lhv_j_per_g)
                           + REAL_ABS(internal_w - least_w);
    const real_t size_w = (REAL_ABS(fuel) * mpc_par.lhv_j_per_g) + REAL_ABS(internal_w);
    return slack_w / real_max(size_w, LEAST_SIZE_W);
}
