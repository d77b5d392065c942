/* One second of the controller: plan, realise on/off, keep safe, degrade in steps. */
#include <stddef.h>

#include "mpc_constants.h"
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"

void mpc_init(mpc_state *state)
{
    unsigned char *const byte = (unsigned char *)state;
    for (size_t i = 0U; i < sizeof(mpc_state); i++) {
        byte[i] = 0U;
    }
    state->old_age = MPC_NO_PLAN;
    state->phase = MPC_PHASE_COLD;
    state->good.soc = mpc_par.soc_init;
    state->good.t_cl_degc = mpc_par.t_cl_init_degc;
    mpc_solver_claim(state);
}

/* Make the values of this second and start at the last solution, or from cold. */
static void prepare(mpc_state *state, const mpc_in *in)
{
    if (state->phase == MPC_PHASE_COLD) {
        mpc_iterate_clear(state);
        mpc_qp_move_origin(state, state->good.soc, state->good.t_cl_degc);
        mpc_qp_linearise_cold(state);
    } else {
        mpc_qp_move_origin(state, state->good.soc, state->good.t_cl_degc);
        mpc_qp_linearise_about_plan(state);
    }
    mpc_qp_road(state, in);
    mpc_qp_update(state);
    mpc_iterate_keep(state);
    mpc_iterate_to_solver_units(state);
    mpc_solver_start(state);
}

/* Convert the iterate back to SI units; returns whether it is usable. If not, the solver is cold:
 * nothing of a failed solve is kept. */
static int32_t conclude(mpc_state *state, int32_t solved)
{
    const int32_t usable = solved & mpc_iterate_usable(state);
    mpc_iterate_to_si_units(state);
    state->phase = (usable != 0) ? MPC_PHASE_RUNNING : MPC_PHASE_COLD;
    if (usable == 0) {
        state->solves = 0;
    } else if (state->solves < MPC_WARM_UP_STEPS) {
        state->solves++;
    } else {
        /* warm */
    }
    return usable;
}

/* One slice: the first of a linearisation takes the remainder that does not fill a whole one. */
static void depart_slice(mpc_state *state, const mpc_in *in)
{
    int32_t count = MPC_ITERATIONS;
    if (state->phase != MPC_PHASE_DEPARTING) {
        prepare(state, in);
        state->phase = MPC_PHASE_DEPARTING;
        state->depart_left = MPC_DEPARTURE_ITERATIONS;
        count = ((MPC_DEPARTURE_ITERATIONS - 1) % MPC_ITERATIONS) + 1;
    }
    const int32_t solved = mpc_solver_iterate(state, count);
    state->depart_left = (solved != 0) ? (state->depart_left - count) : 0;
    if (state->depart_left == 0) {
        state->depart_linearisation++;
        if (conclude(state, solved) == 0) {
            state->depart_linearisation = MPC_DEPARTURE_LINEARISATIONS;
        }
    }
}

int32_t mpc_depart(mpc_state *state, const mpc_in *in)
{
    int32_t result = -1;
    if ((mpc_check_measured(&state->good, in) & mpc_check_preview(in)) != 0) {
        if (state->depart_linearisation < MPC_DEPARTURE_LINEARISATIONS) {
            depart_slice(state, in);
        }
        result = 1;
        if (state->depart_linearisation >= MPC_DEPARTURE_LINEARISATIONS) {
            result = 0;
            if ((state->phase == MPC_PHASE_RUNNING) && (state->is_under_way == 0)) {
                state->solves = MPC_WARM_UP_STEPS;
            }
        }
    }
    return result;
}

/* Prepare the last solution for the start of another second. */
static void move_on(mpc_state *state)
{
    if (state->phase == MPC_PHASE_DEPARTING) {
        (void)conclude(state, 1); /* a departure cut short is a warm start like any other */
    }
    mpc_iterate_shift(state, state->is_under_way);
    if (state->old_age < MPC_NO_PLAN) {
        state->old_age++;
    }
    state->is_under_way = 1;
    state->depart_linearisation = MPC_DEPARTURE_LINEARISATIONS;
}

/* One solve. After a failure the iterate that it started from is used again, if there was one;
 * after FAILURES_FORGIVEN more in a row it may be the cause, and the solver starts cold. */
static int32_t solve(mpc_state *state, const mpc_in *in)
{
    const int32_t phase = state->phase;
    const int32_t solves = state->solves;
    prepare(state, in);
    const int32_t usable = conclude(state, mpc_solver_iterate(state, MPC_ITERATIONS));
    if (usable != 0) {
        state->failures = 0;
    } else {
        const int32_t forgiven = (state->failures < FAILURES_FORGIVEN) ? 1 : 0;
        if ((forgiven != 0) && (phase == MPC_PHASE_RUNNING) && (mpc_iterate_restore(state) != 0)) {
            state->phase = MPC_PHASE_RUNNING;
            state->solves = solves;
        }
        state->failures = (forgiven != 0) ? (state->failures + 1) : 0;
    }
    return usable;
}

static void keep_plan(mpc_state *state)
{
    for (int32_t k = 0; k < MPC_SHORT; k++) {
        state->old_on_share[k] = state->stage[k].x[MPC_VAR_ON];
        state->old_p_eng_w[k] = state->stage[k].x[MPC_VAR_P_ENG];
    }
    state->old_age = 0;
}

/* On from an on-share of one half up, at the power E / on_share. */
static mpc_command realise(const mpc_state *state)
{
    const mpc_real on_share = state->old_on_share[state->old_age];
    mpc_command command = {REAL(0.0), 0};
    if (on_share >= ON_THRESHOLD) {
        command.engine_on = 1;
        command.p_eng_w = state->old_p_eng_w[state->old_age] / real_min(on_share, REAL(1.0));
    }
    return command;
}

int32_t mpc_step(mpc_state *state, const mpc_in *in, mpc_out *out)
{
    static const mpc_out nothing = {REAL(0.0), REAL(0.0), REAL(0.0), 0, MPC_RULES, 0, 0};
    *out = nothing;
    if (mpc_check_measured(&state->good, in) == 0) {
        out->flags |= MPC_BAD_MEASUREMENT;
    }
    if (mpc_check_preview(in) == 0) {
        out->flags |= MPC_BAD_PREVIEW;
    }
    /* the rules are evaluated every second, so that their memory is right if they take over */
    mpc_command command = mpc_rules_decide(&state->rules, &state->good);
    move_on(state);
    if (out->flags == 0) {
        out->iterations = MPC_ITERATIONS;
        if (solve(state, in) == 0) {
            out->flags |= MPC_SOLVER_FAILED;
        } else if (state->solves < MPC_WARM_UP_STEPS) {
            out->flags |= MPC_WARMING_UP;
        } else {
            keep_plan(state);
            out->on_share = state->stage[0].x[MPC_VAR_ON];
            out->relaxation_gap = mpc_qp_relaxation_gap(&state->stage[0]);
        }
    }
    if ((state->old_age <= MPC_PLAN_VALID_STEPS) && (state->old_age < MPC_SHORT)) {
        out->rung = (state->old_age == 0) ? MPC_OPTIMISED : MPC_SHIFTED_PLAN;
        command = mpc_safety_admissible(realise(state), &state->good);
    }
    out->engine_on = command.engine_on;
    out->p_eng_w = command.p_eng_w;
    return out->flags;
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

int32_t mpc_abi(int32_t entry)
{
    static const int32_t entries[MPC_ABI_ENTRIES] = {MPC_ABI_VERSION,
                                                     (int32_t)sizeof(mpc_real),
                                                     (int32_t)sizeof(mpc_in),
                                                     (int32_t)sizeof(mpc_out),
                                                     (int32_t)sizeof(mpc_state),
                                                     MPC_SHORT,
                                                     MPC_LONG,
                                                     MPC_VARS,
                                                     MPC_ROWS,
                                                     MPC_ITERATIONS,
                                                     (int32_t)offsetof(mpc_in, short_count),
                                                     (int32_t)offsetof(mpc_out, engine_on)};
    return ((entry >= 0) && (entry < MPC_ABI_ENTRIES)) ? entries[entry] : -1;
}
