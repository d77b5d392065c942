/* From planned on-shares to on or off: a start or a stop only if the plan keeps to it.
 *
 * On where the share of the coming second is one half at least, but the engine is started only if
 * the mean over its shortest run is one half at least and arrival is no nearer, or if the battery
 * alone cannot drive or the car is too fast for an engine that is off; it is stopped only if the mean
 * over its shortest rest is one half at most, the car is not too fast within it and, where a start
 * costs something, little is left of the run by the plan.
 *
 * The same in Python, with the reasons: qpmpc/controllers/realise.py.
 */
#include "mpc_constants.h"
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"
#include "mpc_must_run.h"

/* Mean on-share over that many seconds of the plan from `first` on, or over all that are left. */
static mpc_real mean_share(const mpc_state *state, int32_t first, int32_t seconds)
{
    mpc_real sum = REAL(0.0);
    int32_t count = 0;
    for (int32_t k = first; k < MPC_SHORT; k++) {
        if (k < (first + seconds)) {
            sum += real_clip(state->old_on_share[k], REAL(0.0), REAL(1.0));
            count++;
        }
    }
    return sum / (mpc_real)count;
}

/* Share from which on a run may go on; that of a start where the plan is no relaxed one: shares of a
 * smoothed dual rise without a start, too. */
static mpc_real stay_share(const mpc_state *state)
{
#if MPC_COSTATE
    return state->cal.on_threshold;
#else
    return real_min(state->cal.on_threshold, STAY_SHARE);
#endif
}

#if MPC_STARTS && !MPC_COSTATE
/* Whether a run goes on although its share is below the threshold: the part of it that goes on is
 * the least share so far, because only a start makes the share of a relaxed plan rise. */
static int32_t stays(const mpc_state *state, int32_t first)
{
    mpc_real least = REAL(1.0);
    mpc_real left_s = REAL(0.0);
    for (int32_t k = first; k < MPC_SHORT; k++) {
        least = real_min(least, real_max(state->old_on_share[k], REAL(0.0)));
        left_s += (k < state->old_arrival_s) ? least : REAL(0.0);
    }
    return ((state->old_on_share[first] >= stay_share(state)) && (left_s >= STAY_S)) ? 1 : 0;
}
#endif

/* Whether the plan starts the engine, or stops it, for long enough. */
static int32_t keeps(const mpc_state *state, int32_t first, int32_t wish)
{
    const mpc_real threshold = state->cal.on_threshold;
    const int32_t bound_s = (wish != 0) ? mpc_par.min_on_s : mpc_par.min_off_s;
    const int32_t left_s = state->old_arrival_s - first;
    const int32_t is_near = ((state->old_arrival_s < MPC_SHORT) && (left_s < bound_s)) ? 1 : 0;
    int32_t seconds = (left_s < bound_s) ? left_s : bound_s;
    seconds = (seconds < 1) ? 1 : seconds;
    const mpc_real mean = mean_share(state, first, seconds);
    int32_t result = 0;
    if (wish != 0) {
        result = ((mean >= threshold) && (is_near == 0)) ? 1 : 0;
    } else {
        /* one that has passed tells nothing of those after it */
        const int32_t fast_s = (state->old_fast_s >= first) ? (state->old_fast_s - first)
                                                            : MPC_SHORT;
        const int32_t is_known = (state->old_fast_s < MPC_SHORT) ? 1 : 0;
        const int32_t is_soon = ((fast_s < bound_s) || (fast_s == 0)) ? is_known : 0;
        result = ((mean <= threshold) && (is_soon == 0)) ? 1 : 0;
#if MPC_STARTS && !MPC_COSTATE
        result = (stays(state, first) != 0) ? 0 : result;
#endif
    }
    return result;
}

/* Command of the second of the plan that has come, at the power E / on_share of the next second before
 * arrival in which the plan runs; the stages behind it keep what they held before. */
mpc_command mpc_realise(const mpc_state *state)
{
    const mpc_measured *const seen = &state->watch.good;
    const mpc_real threshold = state->cal.on_threshold;
    const int32_t first = state->old_age;
    const mpc_real least_w = (first == 0) ? state->old_least_w : REAL(0.0);
    const mpc_real lacking_w = (seen->demand_w + mpc_par.aux_power_w)
                               - mpc_par.battery_discharge_max_w;
    int32_t on = (state->old_on_share[first] >= threshold) ? 1 : 0;
    int32_t must = ((on != 0) && (lacking_w > REAL(0.0))) ? 1 : 0;
    if ((least_w > REAL(0.0)) || (is_too_fast(seen->speed_mps) != 0)) {
        on = 1;
        must = 1;
    }
    if ((on != seen->engine_on) && (must == 0) && (keeps(state, first, on) == 0)) {
        on = seen->engine_on;
    }
    mpc_command command = {REAL(0.0), on};
    int32_t is_found = 0;
    const int32_t left_s = state->old_arrival_s - first;
    const int32_t seconds = (left_s < 1) ? 1 : left_s;
    for (int32_t k = first; k < (first + seconds); k++) {
        const mpc_real share = state->old_on_share[k];
        const mpc_real least = (k == first) ? stay_share(state) : threshold;
        if ((on != 0) && (is_found == 0) && (share >= least)) {
            command.p_eng_w = state->old_p_eng_w[k] / real_min(share, REAL(1.0));
            is_found = 1;
        }
    }
    command.p_eng_w = real_max(command.p_eng_w, least_w); /* above 0 only with the engine on */
    return command;
}
