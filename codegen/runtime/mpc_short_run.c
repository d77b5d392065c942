/* A run of which the plan wants less than the shortest one begins where it costs least.
 *
 * The same in Python, with the rule: qpmpc/controllers/short_run.py.
 */
#include "mpc_constants.h"
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"

mpc_real mpc_short_run_w(const mpc_state *state, const mpc_prices *prices, const mpc_real *on_share,
                         const mpc_going *second)
{
    const int32_t run_s = mpc_par.min_on_s;
    const mpc_real shortest_s = (mpc_real)run_s;
    const mpc_real threshold = state->cal.on_threshold;
    mpc_real runs[MPC_SHORT];  /* 1 where the plan runs the engine, else 0 */
    mpc_real rests[MPC_SHORT]; /* 1 before the first of these seconds, else 0 */
    mpc_real rest = REAL(1.0);
    mpc_real first_s = REAL(0.0);
    mpc_real ran_s = REAL(0.0);
    mpc_real share_s = REAL(0.0); /* in a shortest run from there on */
    mpc_real must = REAL(0.0);    /* whether that second has to run */
    mpc_real seconds = REAL(0.0); /* to arrival */
    for (int32_t k = 0; k < MPC_SHORT; k++) {
        const mpc_stage *const stage = &state->stage[k];
        runs[k] = REAL(1.0) - above(threshold, on_share[k]);
        rest *= REAL(1.0) - runs[k];
        rests[k] = rest;
        const mpc_real on = REAL(1.0) - rest;
        const mpc_real share = real_clip(on_share[k], REAL(0.0), REAL(1.0));
        share_s += (on * above(shortest_s, ran_s)) * share;
        must += (on * above(REAL(0.5), ran_s)) * stage->road.must_share;
        first_s += rest;
        ran_s += on;
        seconds += above(stage->road.duration_s, REAL(0.0));
    }
    mpc_real gain_g = REAL(0.0); /* by a start in s seconds, and the most by a later one */
    mpc_real later_g = REAL(0.0);
    for (int32_t s = MPC_SHORT - run_s - 1; s >= 0; s--) {
        const mpc_real behind_g = real_max(second[s + run_s].dearer, REAL(0.0));
        const mpc_real spared_g = (REAL(1.0) - runs[s + run_s]) * behind_g;
        later_g = real_max(later_g, gain_g);
        gain_g += rests[s] * (spared_g - real_max(second[s].dearer, REAL(0.0)));
    }
    const int32_t is_started = ((must >= threshold) || (share_s >= (threshold * shortest_s))) ? 1
                                                                                              : 0;
    const int32_t is_soon = ((first_s > REAL(0.0)) && (first_s < shortest_s)) ? is_started : 0;
    const int32_t lasts = ((first_s + shortest_s) <= seconds) ? is_soon : 0;
    const int32_t pays = (gain_g > (later_g + SAME_G)) ? lasts : 0;
    const int32_t is_asked = ((mpc_par.polish != 0) && (prices->fuel >= FUEL_LEAST)) ? pays : 0;
    return ((state->watch.good.engine_on == 0) && (is_asked != 0)) ? second[0].power_w : REAL(0.0);
}
