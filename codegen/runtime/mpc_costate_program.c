/* The program of a second: the numbers of each stage. See qpmpc/costate/program.py. */
#include "mpc_constants.h"
#include "mpc_costate_parts.h"
#include "mpc_costate_values.h"
#include "mpc_model.h"
#include "mpc_real.h"

static void put_part(mpc_costate_part *part, mpc_real net_w, mpc_real low_w, mpc_real high_w)
{
    part->net_w = net_w;
    part->low_w = low_w;
    part->high_w = high_w;
    part->low_g_per_s = mpc_costate_shared_fuel(low_w);
    part->high_g_per_s = mpc_costate_shared_fuel(high_w);
}

/* A second has no part without a choice: what would be evaluated of it is nil for good. */
static void put_no_part(mpc_stage *stage)
{
    static const mpc_costate_answer nothing = {
        {REAL(0.0), REAL(0.0), REAL(0.0)}, REAL(0.0), REAL(0.0)};
    static const mpc_drive idle = {REAL(0.0), REAL(0.0), REAL(0.0)};
    stage->answer[MPC_FORCED] = nothing;
    for (int32_t i = 0; i < 2; i++) {
        stage->dual[i].drive[MPC_FORCED] = idle;
        stage->dual[i].on_g[MPC_FORCED] = REAL(0.0);
    }
}

void mpc_costate_program_fill(mpc_state *state)
{
    const mpc_calibration cal = state->cal; /* a copy, which nothing else can change */
    mpc_stage_sums sums = {REAL(0.0)};
#if MPC_STARTS
    mpc_real free_before = REAL(1.0);
#endif
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        mpc_costate_program *const p = &state->stage[k].p;
        const mpc_stage_road *const road = &state->stage[k].road;
        costate_fill(state, &cal, k, &sums);
        p->price_t = p->of.growing;
        if (k > 0) {
            state->stage[k - 1].p.price_t += p->of.growing;
        }
        p->per_end = REAL(1.0) / p->of.t_end;
        p->decay = real_max(-p->of.t_before * p->per_end, LEAST_DECAY);
        p->must = REAL(1.0) - above(REAL(1.0), road->must_share);
        p->cannot = (REAL(1.0) - p->must) * above(mpc_par.engine_min_w, p->of.free_room_w);
        const mpc_real forced = (REAL(1.0) - p->must) * road->must_share;
        const mpc_real free = REAL(1.0) - forced;
        p->part[MPC_FREE].share = free;
        p->part[MPC_FORCED].share = forced;
        p->off_charge = free * p->of.charge_per_w * road->free_internal_off_w;
#if MPC_STARTS
        p->rises = road->rises * free * free_before;
        free_before = free;
#endif
        put_part(&p->part[MPC_FREE], road->free_net_w, p->of.low_w, p->of.high_w);
        if (k < MPC_SHORT) {
            put_no_part(&state->stage[k]);
        } else {
            put_part(&p->part[MPC_FORCED], p->of.forced_net_w, p->of.forced_low_w,
                     p->of.forced_high_w);
        }
        const mpc_real per_s = pick((road->duration_s > REAL(1.0)) ? 1 : 0,
                                    cal.search_long_switch_g_per_s, cal.search_switch_g_per_s);
        p->widest = real_max(per_s * road->duration_s * free, LEAST_SWITCH_G);
        const mpc_real background = BACKGROUND / p->widest;
        const mpc_real takes = free * p->of.charge_per_w * mpc_par.moderate_w;
        const mpc_real warms = free
                               * ((p->of.per_fuel * mpc_par.moderate_g_per_s)
                                  - (p->of.per_power * mpc_par.moderate_w));
        p->least_of_charge = background * takes * takes;
        p->least_of_heat = background * warms * warms;
    }
}

void mpc_costate_smooth(mpc_state *state)
{
    const mpc_real per_usual =
        REAL(1.0) / (state->cal.fuel_scale * mpc_par.usual_charge_g * mpc_par.moderate_w);
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        mpc_costate_program *const p = &state->stage[k].p;
        const mpc_costate_dual *const dual = &state->stage[k].dual[0];
        const mpc_real worth = dual->charge * dual->drive[MPC_FREE].power_w * per_usual;
        const mpc_real part = real_clip(worth, LEAST_WORTH, REAL(1.0));
        p->width = real_max(p->widest * part, LEAST_SWITCH_G);
        p->per_width = REAL(1.0) / p->width;
    }
}
