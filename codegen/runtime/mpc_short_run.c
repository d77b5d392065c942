/* A run of which the plan wants less than the shortest one begins where it costs least.
 *
 * The same in Python, with the rule: qpmpc/controllers/short_run.py.
 */
#include "mpc_constants.h"
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"

mpc_real mpc_short_run_w(const mpc_state *state, const mpc_prices *prices, const mpc_going *second)
{
    const int32_t run_s = mpc_par.min_on_s;
    const mpc_real threshold = state->cal.on_threshold;
    int32_t seconds = 0;
    int32_t first = MPC_SHORT; /* in which the plan runs the engine */
    for (int32_t k = MPC_SHORT - 1; k >= 0; k--) {
        first = (state->stage[k].x[MPC_VAR_ON] >= threshold) ? k : first;
        seconds += (state->stage[k].road.duration_s > REAL(0.0)) ? 1 : 0;
    }
    mpc_real share_s = REAL(0.0); /* of the run that begins there */
    mpc_real must = REAL(0.0);
    for (int32_t k = 0; k < MPC_SHORT; k++) {
        const int32_t in_run = ((k >= first) && (k < (first + run_s))) ? 1 : 0;
        const mpc_real share = real_clip(state->stage[k].x[MPC_VAR_ON], REAL(0.0), REAL(1.0));
        share_s += (in_run != 0) ? share : REAL(0.0);
        must = (k == first) ? state->stage[k].road.must_share : must;
    }
    mpc_real gain_g = REAL(0.0); /* of a start in s seconds, and the greatest of later ones */
    mpc_real most_g = REAL(0.0);
    for (int32_t s = MPC_SHORT - run_s - 1; s >= 0; s--) {
        const mpc_real behind_g = real_max(second[s + run_s].dearer, REAL(0.0));
        const int32_t runs = (state->stage[s + run_s].x[MPC_VAR_ON] >= threshold) ? 1 : 0;
        const mpc_real spared_g = (runs != 0) ? REAL(0.0) : behind_g;
        const mpc_real more_g = spared_g - real_max(second[s].dearer, REAL(0.0));
        most_g = real_max(most_g, gain_g);
        gain_g += (s < first) ? more_g : REAL(0.0);
    }
    const int32_t is_started =
        ((must >= threshold) || (share_s >= (threshold * (mpc_real)run_s))) ? 1 : 0;
    const int32_t lasts =
        ((first > 0) && (first < run_s) && ((first + run_s) <= seconds)) ? is_started : 0;
    const int32_t pays = (gain_g > (most_g + SAME_G)) ? lasts : 0;
    const int32_t is_asked = ((mpc_par.polish != 0) && (prices->fuel >= FUEL_LEAST)) ? pays : 0;
    return ((state->watch.good.engine_on == 0) && (is_asked != 0)) ? second[0].power_w : REAL(0.0);
}
