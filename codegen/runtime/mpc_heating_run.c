/* A run of the engine that goes on, where the coolant would not last to arrival without one more:
 * a plan of shares rounds away what it lacks, the road makes a whole run of it.
 *
 * The same in Python, with the rule: qpmpc/controllers/heating_run.py.
 */
#include "mpc_constants.h"
#include "mpc_heat.h"
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"

mpc_real mpc_heating_run_w(const mpc_state *state, mpc_real power_w)
{
    const mpc_calibration *const cal = &state->cal;
    const mpc_real t_cl_degc = state->watch.good.t_cl_degc;
    const mpc_real fuel_w = (mpc_map_cold_factor(t_cl_degc) * mpc_par.lhv_j_per_g)
                            * mpc_qp_least_fuel(state, power_w, REAL(1.0));
    const mpc_real run_s = (mpc_real)mpc_par.min_on_s;
    const mpc_real heat_w = heat_engine_w(fuel_w, power_w);
    const mpc_real start_j = cal->start_fuel_g * mpc_par.lhv_j_per_g;
    mpc_real lasts_degc = cal->t_cl_min_degc + T_CL_MARGIN_K;
    mpc_real must_s = REAL(0.0);
    mpc_real wanted_s = REAL(0.0);
    for (int32_t k = MPC_STAGES - 1; k >= 0; k--) {
        const mpc_stage_road *const road = &state->stage[k].road;
        const mpc_real per_w = road->duration_s / mpc_par.heat_capacity_j_per_k;
        const mpc_real half_k = (REAL(0.5) * per_w) * heat_cooling_w(lasts_degc, road->speed_mps);
        lasts_degc += per_w * heat_cooling_w(lasts_degc + half_k, road->speed_mps);
        must_s += road->duration_s * road->must_share;
        wanted_s += road->duration_s * real_max(state->stage[k].x[MPC_VAR_ON], REAL(0.0));
    }
    const mpc_real lack_j = mpc_par.heat_capacity_j_per_k * (lasts_degc - t_cl_degc);
    const mpc_real beyond_j = lack_j - (run_s * heat_w);
    const int32_t is_lacking =
        ((lack_j > REAL(0.0)) && ((beyond_j * fuel_w) <= (start_j * heat_w))) ? 1 : 0;
    const int32_t is_wanted = ((wanted_s <= run_s) && (must_s <= MUST_LEAST_S)) ? is_lacking : 0;
    const int32_t is_asked =
        ((state->watch.good.engine_on != 0) && (mpc_par.polish != 0)) ? is_wanted : 0;
    return (is_asked != 0) ? real_max(power_w, IDLING_W) : REAL(0.0);
}
