/* The battery at its lower limit: a run goes on, or begins where it costs least, for what the battery
 * lacks in the seconds ahead.
 *
 * The same in Python, with the rules: qpmpc/controllers/battery_run.py.
 */
#include "mpc_constants.h"
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"

mpc_real mpc_battery_run_w(const mpc_state *state, const mpc_real *on_share,
                           const mpc_going *second)
{
    const int32_t run_s = (mpc_par.min_on_s > 1) ? mpc_par.min_on_s : 1;
    const mpc_real to_spare = state->watch.good.soc - (state->cal.soc_min + SOC_MARGIN);
    mpc_real spent_j = -(mpc_map_energy_j(state->cal.soc_min) * to_spare);
    mpc_real lack_j = REAL(0.0);
    mpc_real rest = REAL(1.0);     /* 1 before the next second that runs, else 0 */
    mpc_real may_begin[MPC_SHORT]; /* 1 up to the first second that lacks, else 0 */
    mpc_real run_g = REAL(0.0);    /* of the shortest run that ends with second k */
    mpc_real now_g = REAL(0.0);    /* of that which begins now, */
    mpc_real is_best = REAL(0.0);  /* 1 if it ends in time and costs least, else 0 */
    for (int32_t k = 0; k < MPC_SHORT; k++) {
        const mpc_stage *const stage = &state->stage[k];
        const mpc_real h = stage->road.duration_s;
        const mpc_real threshold = state->cal.on_threshold;
        rest *= above(threshold, on_share[k]) * above(REAL(0.5), stage->road.must_share);
        may_begin[k] = rest * (REAL(1.0) - above(lack_j, REAL(0.0)));
        spent_j += h * stage->road.internal_off_w;
        lack_j = real_max(lack_j, rest * spent_j);
        run_g += second[k].dearer;
        const int32_t begins_s = (k + 1) - run_s;
        if (begins_s == 0) {
            now_g = run_g;
            is_best = above(h, REAL(0.0));
        }
        if (begins_s > 0) {
            run_g -= second[begins_s - 1].dearer;
            const mpc_real is_open = may_begin[begins_s] * above(h, REAL(0.0));
            is_best *= REAL(1.0) - (is_open * above(now_g + SAME_G, run_g));
        }
    }
    const mpc_real gain_w = second[0].gain_w;
    const mpc_real start_g = state->cal.start_fuel_g;
    const int32_t pays = ((second[0].dearer * lack_j) <= (start_g * gain_w)) ? 1 : 0;
    const int32_t begins = (is_best > REAL(0.5)) ? 1 : 0;
    const int32_t runs = (state->watch.good.engine_on != 0) ? pays : begins;
    const int32_t is_asked = ((mpc_par.polish != 0) && (lack_j > REAL(0.0))) ? runs : 0;
    return (is_asked != 0) ? second[0].power_w : REAL(0.0);
}
