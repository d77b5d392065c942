/* The engine at the coolant's lower limit: a run goes on where the coolant would not last to arrival
 * without one more, and the second that ends what it lacks gives just that.
 *
 * The same in Python, with the rules: qpmpc/controllers/heating_run.py.
 */
#include "mpc_constants.h"
#include "mpc_heat.h"
#include "mpc_learned.h"
#include "mpc_model.h"
#include "mpc_must_run.h"
#include "mpc_parts.h"
#include "mpc_real.h"

/* A second of the running engine: fuel, what it costs more than a rest, heat. */
typedef struct {
    mpc_real fuel_g;
    mpc_real dearer_g;
    mpc_real heat_w;
} heating_second;

/* With LHV times alpha of the coolant, hot_w, and the price of the battery's store. */
static heating_second second_at(const mpc_state *state, mpc_real hot_w, mpc_real store_g_per_j,
                                mpc_real power_w)
{
    const mpc_stage_road *const road = &state->stage[0].road;
    const mpc_real fuel_w = hot_w * least_fuel(state, power_w, REAL(1.0));
    const mpc_real gain_w = road->internal_off_w
                            - mpc_map_planned_internal_w(road->net_w - power_w);
    const mpc_real fuel_g = fuel_w / mpc_par.lhv_j_per_g;
    const heating_second second = {fuel_g, fuel_g - (store_g_per_j * gain_w),
                                   heat_engine_w(fuel_w, power_w)};
    return second;
}

/* Power that gives this heat: the least over the pieces of the fuel curve on which heat grows with
 * power. */
static mpc_real power_of(const mpc_state *state, mpc_real hot_w, mpc_real heat_w)
{
    const mpc_real inside_w = heat_w / heat_engine_w(REAL(1.0), REAL(0.0));
    mpc_real power_w = REAL(2.0) * mpc_par.engine_max_w; /* more than can be had */
    for (int32_t i = 0; i < FUEL_PIECES; i++) {
        const mpc_real above_w = inside_w - (hot_w * FUEL_INTERCEPT(i));
        const mpc_real growth = (hot_w * FUEL_SLOPE(i)) - REAL(1.0);
        const mpc_real of_piece_w = above_w / real_max(growth, LEAST_GROWTH);
        power_w = (growth > LEAST_GROWTH) ? real_min(power_w, of_piece_w) : power_w;
    }
    return power_w;
}

mpc_real mpc_heating_run_w(const mpc_state *state, const mpc_prices *prices, mpc_real power_w,
                           int32_t is_planned)
{
    const mpc_calibration *const cal = &state->cal;
    const mpc_real t_cl_degc = state->watch.good.t_cl_degc;
    const mpc_real hot_w = mpc_map_cold_factor(t_cl_degc) * mpc_par.lhv_j_per_g;
    const mpc_real limit_degc = cal->t_cl_min_degc + T_CL_MARGIN_K;
    const mpc_real run_s = real_max((mpc_real)mpc_par.min_on_s, REAL(1.0));
    mpc_real lasts_degc = limit_degc;
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
    const mpc_measured *const good = &state->watch.good;
    const int32_t engine_on = good->engine_on;
    const mpc_real held_s = (mpc_real)begun_s(engine_on, good->engine_for_s);
    const int32_t may = ((engine_on != 0) || (mpc_par.min_on_s <= 1)) ? 1 : 0;
    const int32_t runs_anyway = ((MPC_STARTS == 0) && (is_planned != 0) && (may != 0)) ? 1 : 0;
    const mpc_real most_s = run_s + (mpc_real)runs_anyway;
    const mpc_real lack_j = mpc_par.heat_capacity_j_per_k * (lasts_degc - t_cl_degc);
    const int32_t is_lacking = ((lack_j > REAL(0.0)) && (wanted_s <= most_s)
                                && (held_s <= REAL(1.0)) && ((must_s - held_s) <= MUST_LEAST_S))
                                   ? 1
                                   : 0;
    const int32_t is_asked = ((mpc_par.polish != 0) && (is_lacking != 0)) ? 1 : 0;

    const heating_second one = second_at(state, hot_w, prices->internal, power_w);
    const mpc_real beyond_j = lack_j - (run_s * one.heat_w);
    const int32_t pays = ((beyond_j * one.fuel_g) <= (cal->start_fuel_g * one.heat_w)) ? 1 : 0;
    const mpc_real rested_degc = t_cl_degc
                                 - (heat_cooling_w(t_cl_degc, state->stage[0].road.speed_mps)
                                    / mpc_par.heat_capacity_j_per_k);
    const int32_t is_cold = (rested_degc < limit_degc) ? 1 : 0;
    const int32_t goes_on = ((MPC_STARTS != 0) && (engine_on != 0)) ? 1 : 0;
    const int32_t needs = ((is_cold != 0) || (runs_anyway != 0)) ? 1 : 0;
    const int32_t runs = (goes_on != 0) ? pays : needs;

    const mpc_real start_w = heat_engine_w(cal->start_fuel_g * mpc_par.lhv_j_per_g, REAL(0.0));
    const mpc_real others_j = start_w + ((run_s - REAL(1.0)) * one.heat_w);
    const mpc_real ends_j = lack_j + (BEYOND_K * mpc_par.heat_capacity_j_per_k);
    const mpc_real left_w = (engine_on != 0) ? ends_j : (ends_j - others_j);
    const mpc_real all_w = power_of(state, hot_w, left_w);
    const mpc_real all_dearer_g = second_at(state, hot_w, prices->internal, all_w).dearer_g;
    const mpc_real before_w = (engine_on != 0) ? state->watch.good.p_eng_before_w : REAL(0.0);
    const mpc_real ramped_w = (before_w + cal->ramp_w_per_s) - POWER_MARGIN_W;
    const mpc_real charged_w = state->stage[0].road.net_w + mpc_par.battery_charge_max_w;
    const mpc_real most_w = real_min(real_min(mpc_par.engine_max_w, ramped_w), charged_w);
    const int32_t is_last = ((left_w > one.heat_w) && (left_w < (REAL(2.0) * one.heat_w))) ? 1 : 0;
    const int32_t pays_all = (all_dearer_g <= (REAL(2.0) * one.dearer_g)) ? is_last : 0;
    const int32_t ends = (all_w <= most_w) ? pays_all : 0;
    const mpc_real least_w = (goes_on != 0) ? real_max(power_w, IDLING_W) : REAL(0.0);
    const mpc_real wanted_w = (ends != 0) ? all_w : least_w;
    return ((is_asked != 0) && (runs != 0)) ? wanted_w : REAL(0.0);
}
