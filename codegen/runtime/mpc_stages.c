/* The stages of a second: the road ahead, the state that they start at, and the point about which
 * the coolant is expanded. The same for every method.
 */
#include "mpc_battery_side.h"
#include "mpc_constants.h"
#include "mpc_model.h"
#include "mpc_must_run.h"
#include "mpc_parts.h"
#include "mpc_real.h"

/* What the road beyond each block puts into the battery by itself. */
static void take_refill(mpc_state *state)
{
    mpc_real beyond_j = REAL(0.0);
    mpc_real spent_j = REAL(0.0);
    for (int32_t k = MPC_LONG - 1; k >= 0; k--) {
        mpc_stage_road *const road = &state->stage[MPC_SHORT + k].road;
        const int32_t ends_block = ((k % MPC_CLASSES) == (MPC_CLASSES - 1)) ? 1 : 0;
        beyond_j = (ends_block != 0) ? real_max(beyond_j - spent_j, REAL(0.0)) : beyond_j;
        spent_j = ((ends_block != 0) ? REAL(0.0) : spent_j)
                  + (road->duration_s * road->internal_off_w);
        road->refill_j = (ends_block != 0) ? beyond_j : REAL(0.0);
    }
}

#if MPC_COSTATE
/* Starts per on-share that a stage has more than the one before: what rises into a class of a block,
 * falls from it to the next stage, the class below. Blocks share prices alone. */
static mpc_real rises_of(const mpc_state *state, const mpc_in *in, int32_t k)
{
    return ((k % MPC_CLASSES) > 0) ? -(state->cal.rise_share * in->long_rises[k - 1]) : REAL(0.0);
}
#else
/* Whether a block has seconds of the classes from one stage up to another. */
static int32_t has(const mpc_in *in, int32_t from, int32_t to)
{
    int32_t found = 0;
    for (int32_t k = from; k < to; k++) {
        found |= (in->long_duration_s[k] > REAL(0.0)) ? 1 : 0;
    }
    return found;
}

/* Starts per on-share that a stage has more than the one before. What rises into a class of a block,
 * falls from it to the next stage, the class below; the first is entered from the block before, and
 * classes without a second hand its last on-share on. */
static mpc_real rises_of(const mpc_state *state, const mpc_in *in, int32_t k)
{
    const int32_t begins = k - (k % MPC_CLASSES);
    const int32_t inside = has(in, begins, k) & has(in, k, begins + MPC_CLASSES);
    const mpc_real rises = (k > begins) ? (in->long_rises[k - 1] - mpc_par.entry_share) : REAL(0.0);
    const mpc_real falls = state->cal.rise_share * real_max(rises, REAL(0.0));
    const mpc_real enters = (MPC_CLASSES > 1) ? mpc_par.entry_share : REAL(0.0);
    return ((inside != 0) || (enters <= REAL(0.0))) ? -falls : enters;
}
#endif

/* Preview to stages: seconds first, then the classes of each block; past stages are masked. */
void mpc_stages_take(mpc_state *state, const mpc_in *in)
{
    const int32_t left_s = begun_s(state->watch.good.engine_on, state->watch.good.engine_for_s);
    const int32_t held_s = (left_s < in->short_count) ? left_s : in->short_count;
    for (int32_t k = 0; k < MPC_SHORT; k++) {
        mpc_stage *const stage = &state->stage[k];
        const mpc_real seen = above((mpc_real)in->short_count, (mpc_real)k);
        stage->road.duration_s = seen;
        stage->road.net_w = seen * battery_side_w(in->short_demand_w[k]);
        stage->road.speed_mps = seen * in->short_speed_mps[k];
        stage->road.internal_off_w = mpc_map_planned_internal_w(stage->road.net_w);
        const int32_t held = (k < held_s) ? 1 : 0;
        const int32_t must = held | must_run(stage->road.net_w, stage->road.speed_mps);
        stage->road.must_share = (mpc_real)must;
        stage->road.free_net_w = stage->road.net_w;
        stage->road.free_internal_off_w = stage->road.internal_off_w;
        stage->road.rises = seen;
        stage->road.fall_j = REAL(0.0);
        stage->road.rise_j = (k == (MPC_SHORT - 1)) ? in->short_rise_j : REAL(0.0);
        stage->road.refill_j = REAL(0.0);
    }
    for (int32_t k = 0; k < MPC_LONG; k++) {
        mpc_stage *const stage = &state->stage[MPC_SHORT + k];
        stage->road.duration_s = in->long_duration_s[k];
        stage->road.net_w = in->long_net_w[k];
        stage->road.speed_mps = in->long_speed_mps[k];
        stage->road.internal_off_w = in->long_internal_off_w[k];
        stage->road.must_share = in->long_must_share[k];
        stage->road.free_net_w = in->long_free_net_w[k];
        stage->road.free_internal_off_w = in->long_free_internal_off_w[k];
        stage->road.rises = rises_of(state, in, k);
        /* inside a block SOC is not limited: the order of its classes in time is not known */
        const int32_t ends_block = ((k % MPC_CLASSES) == (MPC_CLASSES - 1)) ? 1 : 0;
        stage->road.fall_j = (ends_block != 0) ? in->long_fall_j[k] : -NO_LIMIT_J;
        stage->road.rise_j = (ends_block != 0) ? in->long_rise_j[k] : -NO_LIMIT_J;
    }
    take_refill(state);
}

/* The last good preview, some seconds later: short stages move up and are masked at the end. */
void mpc_stages_move_up(mpc_state *state, int32_t by)
{
    const int32_t left_s = begun_s(state->watch.good.engine_on, state->watch.good.engine_for_s);
    for (int32_t k = 0; k < MPC_SHORT; k++) {
        const int32_t from = k + by;
        mpc_stage_road *const road = &state->stage[k].road;
        const mpc_stage_road *const later =
            &state->stage[(from < MPC_SHORT) ? from : (MPC_SHORT - 1)].road;
        const mpc_real seen = (from < MPC_SHORT) ? REAL(1.0) : REAL(0.0);
        road->duration_s = seen * later->duration_s;
        road->net_w = seen * later->net_w;
        road->speed_mps = seen * later->speed_mps;
        road->internal_off_w = seen * later->internal_off_w;
        const int32_t held = ((k < left_s) && (road->duration_s > REAL(0.0))) ? 1 : 0;
        const int32_t must = held | must_run(road->net_w, road->speed_mps);
        road->must_share = (mpc_real)must;
        road->free_net_w = seen * later->free_net_w;
        road->free_internal_off_w = seen * later->free_internal_off_w;
        road->rises = seen * later->rises;
        road->fall_j = REAL(0.0);
        road->rise_j = seen * later->rise_j;
    }
}

/* Count SOC and coolant temperature from a newly measured state. */
void mpc_stages_move_origin(mpc_state *state, mpc_real soc, mpc_real t_cl_degc)
{
    const mpc_real soc_step = state->origin_soc - soc;
    const mpc_real t_cl_step = state->origin_t_cl_degc - t_cl_degc;
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        state->stage[k].x[MPC_VAR_SOC] += soc_step;
        state->stage[k].x[MPC_VAR_T_CL] += t_cl_step;
    }
    state->origin_soc = soc;
    state->origin_t_cl_degc = t_cl_degc;
}

void mpc_stages_expand_cold(mpc_state *state)
{
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        state->stage[k].road.about_t_cl_degc = state->origin_t_cl_degc;
        state->stage[k].road.about_fuel_g_per_s = DEPARTURE_FUEL_G_PER_S;
        state->stage[k].road.about_p_eng_w = DEPARTURE_P_ENG_W;
        state->stage[k].road.about_t_cl_start_degc = state->origin_t_cl_degc;
        state->stage[k].road.about_t_cl_end_degc = state->origin_t_cl_degc;
    }
}

/* From the point of this second to the plan, in SI units: the next second's point. All of the way,
 * or a part of it where the search goes on from second to second: about plans that are far from the
 * best its program would be another one every second, and it would never catch up. */
void mpc_stages_follow_plan(mpc_state *state)
{
#if MPC_COSTATE
    const mpc_real part = (state->phase == MPC_PHASE_RUNNING) ? EXPANSION_STEP : REAL(1.0);
#else
    const mpc_real part = REAL(1.0);
#endif
    const mpc_real rest = REAL(1.0) - part;
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        mpc_stage_road *const road = &state->stage[k].road;
        const mpc_real *const x = state->stage[k].x;
        const mpc_real end = state->origin_t_cl_degc + x[MPC_VAR_T_CL];
        road->about_t_cl_end_degc = (rest * road->about_t_cl_end_degc) + (part * end);
        road->about_fuel_g_per_s = (rest * road->about_fuel_g_per_s) + (part * x[MPC_VAR_FUEL]);
        road->about_p_eng_w = (rest * road->about_p_eng_w) + (part * x[MPC_VAR_P_ENG]);
    }
}

/* The point, moved up with the plan. alpha is taken at the mean temperature of a stage's own ends,
 * for demand classes at that of their block's: the class that is driven first in the plan is in
 * reality spread over the block. */
void mpc_stages_expand_about_plan(mpc_state *state)
{
    mpc_real start = real_clip(state->origin_t_cl_degc, COLDEST_DEGC, HOTTEST_DEGC);
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        mpc_stage_road *const road = &state->stage[k].road;
        road->about_t_cl_start_degc = start;
        road->about_t_cl_end_degc =
            real_clip(road->about_t_cl_end_degc, COLDEST_DEGC, HOTTEST_DEGC);
        road->about_t_cl_degc = REAL(0.5) * (start + road->about_t_cl_end_degc);
        /* no usable solution is beyond the upper bounds, corrupted memory may be */
        road->about_fuel_g_per_s = real_clip(road->about_fuel_g_per_s, REAL(0.0),
                                             LARGEST_PLAUSIBLE * mpc_par.unit_fuel_g_per_s);
        road->about_p_eng_w =
            real_clip(road->about_p_eng_w, REAL(0.0), LARGEST_PLAUSIBLE * mpc_par.unit_power_w);
        start = road->about_t_cl_end_degc;
    }
    for (int32_t k = MPC_SHORT; k < MPC_STAGES; k += MPC_CLASSES) {
        mpc_stage *const block = &state->stage[k];
        const mpc_stage_road *const last = &block[MPC_CLASSES - 1].road;
        const mpc_real mean = REAL(0.5)
                              * (block[0].road.about_t_cl_start_degc + last->about_t_cl_end_degc);
        for (int32_t i = 0; i < MPC_CLASSES; i++) {
            block[i].road.about_t_cl_degc = mean;
        }
    }
}
