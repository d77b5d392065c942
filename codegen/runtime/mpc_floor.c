/* Coolant temperature to be had in good time before an engine beside a full battery cannot heat.
 *
 * Forwards: the battery, discharged wherever it can be, is filled by long braking; a share of what
 * is left of it is all that the engine can charge. Backwards from arrival, where heat is of no use
 * any more: the coolant that is lost beyond the engine's largest heat. See qpmpc.qp.coolant_floor.
 */
#include "mpc_constants.h"
#include "mpc_heat.h"
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"

/* Rise of the coolant over a stage by the engine's largest heat, K. */
static mpc_real largest_gain_k(const mpc_stage_road *road, mpc_real room, mpc_real factor)
{
    const mpc_real regen =
        real_clip(-road->net_w / mpc_par.battery_charge_max_w, REAL(0.0), REAL(1.0));
    const mpc_real charged_w = (USABLE * room * mpc_par.battery_energy_j * (REAL(1.0) - regen))
                               / real_max(road->duration_s, REAL(1.0));
    const mpc_real wanted_w = real_max(road->net_w, mpc_par.aux_power_w)
                              + real_min(charged_w, mpc_par.battery_charge_max_w);
    const mpc_real power_w = real_clip(wanted_w, mpc_par.engine_min_w, mpc_par.engine_max_w);
    const mpc_real fuel_w = factor * mpc_map_fuel_g_per_s(power_w);
    return (road->duration_s * heat_engine_w(fuel_w, power_w)) / mpc_par.heat_capacity_j_per_k;
}

void mpc_floor_find(mpc_state *state, mpc_real soc)
{
    const mpc_calibration *const cal = &state->cal;
    mpc_real gain_k[MPC_STAGES];
    const mpc_real factor = (mpc_map_cold_factor(cal->t_cl_min_degc) * mpc_par.lhv_j_per_g)
                            * cal->fuel_scale;
    const mpc_real widest = cal->soc_max - cal->soc_min;
    mpc_real room = cal->soc_max - real_clip(soc, cal->soc_min, cal->soc_max);
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        const mpc_stage_road *const road = &state->stage[k].road;
        gain_k[k] = largest_gain_k(road, room, factor);
        room += (road->duration_s * road->internal_off_w) / mpc_par.battery_energy_j;
        room = real_clip(room, REAL(0.0), widest);
    }
    const mpc_real most =
        real_max(REAL(0.5) * (cal->t_cl_min_degc + cal->t_cl_max_degc), cal->t_min_degc);
    /* an engine at rest may coast to the limit: heat left at arrival is of no use */
    mpc_real coasting_degc = real_min(cal->t_cl_min_degc + ARRIVAL_K, cal->t_min_degc);
    mpc_real floor_degc = coasting_degc;
    state->highest_floor_degc = floor_degc;
    for (int32_t k = MPC_STAGES - 1; k >= 0; k--) {
        mpc_stage_road *const road = &state->stage[k].road;
        road->floor_degc = floor_degc;
        state->highest_floor_degc = real_max(state->highest_floor_degc, floor_degc);
        const mpc_real lost_k = (road->duration_s * heat_cooling_w(floor_degc, road->speed_mps))
                                / mpc_par.heat_capacity_j_per_k;
        coasting_degc = real_min(coasting_degc + lost_k, cal->t_min_degc);
        floor_degc = real_clip((floor_degc + lost_k) - gain_k[k], coasting_degc, most);
    }
}
