/* One second of the controller: plan, realise on/off, keep safe, degrade in steps. */
#include <stddef.h>

#include "mpc_constants.h"
#include "mpc_learned.h"
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"
#include "mpc_must_run.h"

/* Apart from mpc_init, which nothing in this file may call alone (MISRA C:2012 8.7). */
static void set_defined(mpc_state *state)
{
    unsigned char *const byte = (unsigned char *)state;
    for (size_t i = 0U; i < sizeof(mpc_state); i++) {
        byte[i] = 0U;
    }
    state->magic = MPC_MAGIC;
    state->magic_end = MPC_MAGIC;
    state->old_age = MPC_NO_PLAN;
    state->road_age = MPC_NO_PLAN;
    state->heard.age = MPC_NO_PLAN;
    state->phase = MPC_PHASE_COLD;
    state->calibration = mpc_par.calibration;
    state->cal = mpc_par.calibration;
    state->watch.good.soc = mpc_par.soc_init;
    state->watch.good.t_cl_degc = mpc_par.t_cl_init_degc;
    state->watch.soc_since_s = LONG_AGO_S;
    state->watch.t_cl_since_s = LONG_AGO_S;
    mpc_method_claim(state);
}

void mpc_init(mpc_state *state) { set_defined(state); }

/* Make the values of this second and start at the last solution, or from cold. */
static void prepare(mpc_state *state)
{
    const mpc_measured *const good = &state->watch.good;
    if (state->phase == MPC_PHASE_COLD) {
        mpc_iterate_clear(state);
        mpc_stages_move_origin(state, good->soc, good->t_cl_degc);
        mpc_stages_expand_cold(state);
    } else {
        mpc_stages_move_origin(state, good->soc, good->t_cl_degc);
        mpc_stages_expand_about_plan(state);
    }
    mpc_floor_find(state, good->soc);
    mpc_iterate_keep(state);
    mpc_method_start(state);
}

/* Convert the iterate back to SI units; returns whether it is usable. If not, the solver is cold:
 * nothing of a failed solve is kept. */
static int32_t conclude(mpc_state *state, int32_t solved)
{
    const int32_t usable = mpc_method_finish(state, solved);
    if (usable != 0) {
        mpc_stages_follow_plan(state);
    }
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
        mpc_stages_take(state, in);
        state->road_age = 0;
        prepare(state);
        state->phase = MPC_PHASE_DEPARTING;
        state->depart_left = MPC_DEPARTURE_ITERATIONS;
        count = ((MPC_DEPARTURE_ITERATIONS - 1) % MPC_ITERATIONS) + 1;
    }
    const int32_t solved = mpc_method_iterate(state, count);
    const int32_t goes_on = ((solved != 0) && (state->depart_left > count)) ? 1 : 0;
    state->depart_left = (goes_on != 0) ? (state->depart_left - count) : 0;
    if (state->depart_left == 0) {
        state->depart_linearisation++;
        if (conclude(state, solved) == 0) {
            state->depart_linearisation = MPC_DEPARTURE_LINEARISATIONS;
        }
    }
}

/* The measurements of a departure, each on its own: the trip has not begun. */
static int32_t measured_before_departure(mpc_state *state, const mpc_in *in)
{
    int32_t elapsed = 0;
    (void)mpc_calibration_take(state); /* a wrong one is flagged in the first second */
    const int32_t flags = mpc_check_measured(&state->watch, &state->cal, in, &elapsed);
    state->watch.has_clock = 0;
    state->watch.soc_since_s = LONG_AGO_S;
    state->watch.t_cl_since_s = LONG_AGO_S;
    return (flags == 0) ? 1 : 0;
}

int32_t mpc_depart(mpc_state *state, const mpc_in *in)
{
    int32_t result = -1;
    if (mpc_check_state(state) == 0) {
        /* not initialised */
    } else if (state->is_under_way != 0) {
        result = 0;
    } else if ((measured_before_departure(state, in) & mpc_preview_first(&state->heard, in)) != 0) {
        if (state->depart_linearisation < MPC_DEPARTURE_LINEARISATIONS) {
            depart_slice(state, in);
        }
        result = 1;
        if (state->depart_linearisation >= MPC_DEPARTURE_LINEARISATIONS) {
            result = 0;
            if (state->phase == MPC_PHASE_RUNNING) {
                state->solves = MPC_WARM_UP_STEPS;
            }
        }
    } else {
        /* bad input */
    }
    return result;
}

/* Prepare the last solution for the start of another second. */
static void move_on(mpc_state *state, int32_t passed)
{
    if (state->phase == MPC_PHASE_DEPARTING) {
        (void)conclude(state, 1); /* a departure cut short is a warm start like any other */
    }
    mpc_iterate_shift(state, passed);
    const int32_t old_age = state->old_age + passed;
    state->old_age = (old_age < MPC_NO_PLAN) ? old_age : MPC_NO_PLAN;
    state->is_under_way = 1;
    state->depart_linearisation = MPC_DEPARTURE_LINEARISATIONS;
}

/* Take the preview of this second, or the last good one, moved up; returns whether there is one. */
static int32_t take_preview(mpc_state *state, const mpc_in *in, int32_t passed, int32_t *flags)
{
    if (mpc_preview_check(&state->heard, in, passed) != 0) {
        mpc_stages_take(state, in);
        state->road_age = 0;
    } else {
        *flags |= MPC_BAD_PREVIEW;
        if (((state->road_age + passed) < MPC_SHORT) && (mpc_preview_check_kept(state) != 0)) {
            mpc_stages_move_up(state, passed);
            state->road_age += passed;
        } else {
            state->road_age = MPC_NO_PLAN;
        }
    }
    return (state->road_age < MPC_SHORT) ? 1 : 0;
}

/* Only for the injection of faults: a build may say that the solver fails. */
#if !defined(MPC_SOLVER_MAY_SUCCEED)
#define MPC_SOLVER_MAY_SUCCEED 1
#endif

/* One solve. After a failure the iterate that it started from is used again, if there was one;
 * after FAILURES_FORGIVEN more in a row it may be the cause, and the solver starts cold. */
static int32_t solve(mpc_state *state)
{
    const int32_t phase = state->phase;
    const int32_t solves = state->solves;
    prepare(state);
    const int32_t usable =
        conclude(state, mpc_method_iterate(state, MPC_ITERATIONS) & MPC_SOLVER_MAY_SUCCEED);
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
    state->old_arrival_s = 0;
    state->old_fast_s = MPC_SHORT;
    for (int32_t k = 0; k < MPC_SHORT; k++) {
        const int32_t is_fast = is_too_fast(state->stage[k].road.speed_mps);
        if ((is_fast != 0) && (state->old_fast_s == MPC_SHORT)) {
            state->old_fast_s = k;
        }
        state->old_arrival_s += (state->stage[k].road.duration_s > REAL(0.0)) ? 1 : 0;
    }
    state->old_least_w = mpc_method_plan(state, state->old_on_share, state->old_p_eng_w);
    state->old_age = 0;
}

int32_t mpc_step(mpc_state *state, const mpc_in *in, mpc_out *out)
{
    static const mpc_out nothing = {REAL(0.0), REAL(0.0), REAL(0.0), 0, MPC_RULES, 0, 0, -1};
    int32_t elapsed = 1;
    *out = nothing;
    if (mpc_check_state(state) == 0) {
        set_defined(state);
        out->flags = MPC_BAD_STATE;
    }
    out->wrong_entry = mpc_calibration_take(state);
    out->flags |= (out->wrong_entry < 0) ? 0 : MPC_BAD_CALIBRATION;
    mpc_watch *const watch = &state->watch;
    out->flags |= mpc_check_measured(watch, &state->cal, in, &elapsed);
    /* the rules are evaluated every second, so that their memory is right if they take over */
    mpc_command command = mpc_rules_decide(&state->rules, &watch->good, &state->cal);
#if MPC_LEARNING
    mpc_learned_take(state);
#endif
    const int32_t passed = (state->is_under_way != 0) ? elapsed : 0;
    move_on(state, passed);
    int32_t is_new = 0;
    if (take_preview(state, in, passed, &out->flags) != 0) {
        out->iterations = MPC_ITERATIONS;
        if (solve(state) == 0) {
            out->flags |= MPC_SOLVER_FAILED;
        } else if (state->solves < MPC_WARM_UP_STEPS) {
            out->flags |= MPC_WARMING_UP;
        } else {
            is_new = 1;
            keep_plan(state);
            out->on_share = state->old_on_share[0];
            mpc_method_report(state, out);
        }
    }
    if ((state->old_age <= MPC_PLAN_VALID_STEPS) && (state->old_age < MPC_SHORT)) {
        out->rung = (is_new != 0) ? MPC_OPTIMISED : MPC_SHIFTED_PLAN;
        command = mpc_realise(state);
    }
    command = mpc_safety_admissible(command, &watch->good, &state->cal);
    watch->command_on = command.engine_on;
    watch->command_w = command.p_eng_w;
    out->engine_on = command.engine_on;
    out->p_eng_w = command.p_eng_w;
    return out->flags;
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
                                                     (int32_t)offsetof(mpc_out, engine_on),
                                                     (int32_t)offsetof(mpc_state, calibration),
                                                     MPC_CAL_ENTRIES};
    return ((entry >= 0) && (entry < MPC_ABI_ENTRIES)) ? entries[entry] : -1;
}
