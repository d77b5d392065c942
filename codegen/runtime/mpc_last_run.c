/* A run of the engine that goes on, where the rest of the trip wants less than one more: the plan gets
 * that by a part of a start, the road by a whole one.
 *
 * The same in Python, with the rule: qpmpc/qp/last_run.py.
 */
#include "mpc_constants.h"
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"

mpc_real mpc_last_run_w(const mpc_state *state, const mpc_prices *prices, mpc_real power_w)
{
    const mpc_stage_road *const now = &state->stage[0].road;
    const mpc_real gain_w = now->internal_off_w - mpc_map_planned_internal_w(now->net_w - power_w);
    const mpc_real spent = (prices->fuel * mpc_qp_least_fuel(state, power_w, REAL(1.0)))
                           + (prices->p_eng * power_w);
    const mpc_real dearer = spent - (prices->internal * gain_w);
    mpc_real wanted_j = REAL(0.0);
    mpc_real must_s = REAL(0.0);
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        const mpc_stage *const stage = &state->stage[k];
        const mpc_real taken_w = stage->road.internal_off_w - stage->x[MPC_VAR_INTERNAL];
        wanted_j += stage->road.duration_s * taken_w;
        must_s += stage->road.duration_s * stage->road.must_share;
    }
    const mpc_real wanted_s = wanted_j / real_max(gain_w, LEAST_GAIN_W);
    const mpc_real run_s = (mpc_real)mpc_par.min_on_s;
    const int32_t is_one_run = ((wanted_s >= (WANTED_LEAST * run_s)) && (wanted_s <= run_s)) ? 1
                                                                                             : 0;
    const int32_t pays =
        ((gain_w >= LEAST_GAIN_W) && ((dearer * wanted_s) <= state->cal.start_fuel_g)) ? is_one_run
                                                                                       : 0;
    const int32_t is_asked = ((state->watch.good.engine_on != 0) && (mpc_par.polish != 0)
                              && (must_s <= MUST_LEAST_S) && (prices->fuel >= FUEL_LEAST))
                                 ? 1
                                 : 0;
    return ((pays != 0) && (is_asked != 0)) ? power_w : REAL(0.0);
}
