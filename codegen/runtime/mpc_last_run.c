/* The last run of the engine, of which a plan of shares wants a part: the one before goes on for it, or
 * it begins in time, before nothing but standstill is left.
 *
 * The same in Python, with the rules: qpmpc/controllers/last_run.py.
 */
#include "mpc_constants.h"
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"

/* Energy that the plan takes from the engine in its first stages. */
static mpc_real wanted_j(const mpc_state *state, int32_t stages)
{
    mpc_real sum = REAL(0.0);
    for (int32_t k = 0; k < stages; k++) {
        const mpc_stage *const stage = &state->stage[k];
        const mpc_real taken_w = stage->road.internal_off_w - stage->x[MPC_VAR_INTERNAL];
        sum += stage->road.duration_s * taken_w;
    }
    return sum;
}

/* Whether energy decides: no second ahead has to run anyway, and the plan does not want heat. */
static int32_t is_asked(const mpc_state *state, const mpc_prices *prices)
{
    mpc_real must_s = REAL(0.0);
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        must_s += state->stage[k].road.duration_s * state->stage[k].road.must_share;
    }
    return ((mpc_par.polish != 0) && (must_s <= MUST_LEAST_S) && (prices->fuel >= FUEL_LEAST)) ? 1
                                                                                               : 0;
}

mpc_real mpc_last_run_w(const mpc_state *state, const mpc_prices *prices, const mpc_going *now)
{
    const mpc_real wanted_s = wanted_j(state, MPC_STAGES) / real_max(now->gain_w, LEAST_GAIN_W);
    const mpc_real run_s = (mpc_real)mpc_par.min_on_s;
    const int32_t is_one_run = ((wanted_s >= (WANTED_LEAST * run_s)) && (wanted_s <= run_s)) ? 1
                                                                                             : 0;
    const int32_t pays =
        ((now->gain_w >= LEAST_GAIN_W) && ((now->dearer * wanted_s) <= state->cal.start_fuel_g))
            ? is_one_run
            : 0;
    const int32_t goes =
        ((state->watch.good.engine_on != 0) && (is_asked(state, prices) != 0)) ? pays : 0;
    return (goes != 0) ? now->power_w : REAL(0.0);
}

mpc_real mpc_last_start_w(const mpc_state *state, const mpc_prices *prices, const mpc_going *second)
{
    const int32_t run_s = mpc_par.min_on_s;
    mpc_real dearer_g[MPC_SHORT];
    mpc_real gives_j = REAL(0.0);
    mpc_real lasts_s = REAL(0.0);
    mpc_real goes_on_g = REAL(0.0); /* of the run from now on, after the shortest, up to second k */
    mpc_real best_g = REAL(0.0);
    mpc_real now_g = REAL(0.0);
    mpc_real run_g = REAL(0.0); /* of the run that ends with second k */
    mpc_real least_g = REAL(0.0);
    for (int32_t k = 0; k < MPC_SHORT; k++) {
        const mpc_real h = state->stage[k].road.duration_s;
        dearer_g[k] = h * second[k].dearer;
        run_g += dearer_g[k];
        if (k < run_s) {
            gives_j += h * second[k].gain_w;
            lasts_s += h;
            now_g = run_g;
        } else {
            run_g -= dearer_g[k - run_s];
            least_g = real_min(least_g, run_g);
            goes_on_g += dearer_g[k];
            best_g = real_min(best_g, goes_on_g);
        }
    }
    const mpc_real all_j = wanted_j(state, MPC_STAGES);
    const mpc_real soon_j = wanted_j(state, MPC_SHORT);
    const int32_t is_one_run =
        ((all_j >= (START_LEAST * gives_j)) && (all_j <= (START_MOST * gives_j))) ? 1 : 0;
    const int32_t is_soon = (soon_j >= (START_SOON * all_j)) ? is_one_run : 0;
    const int32_t is_best = (now_g <= (least_g + SAME_G)) ? is_soon : 0;
    const mpc_real start_g = START_PAYS * state->cal.start_fuel_g;
    const int32_t pays = ((now_g + best_g) <= -start_g) ? is_best : 0;
    const int32_t lasts = ((run_s > 0) && (lasts_s >= (mpc_real)run_s)) ? pays : 0;
    const int32_t begins =
        ((state->watch.good.engine_on == 0) && (is_asked(state, prices) != 0)) ? lasts : 0;
    return (begins != 0) ? second[0].power_w : REAL(0.0);
}
