/* The plant: eqs. (1) to (5) of the paper, written as qpmpc.vehicle.plant is. */
#include "mpc_plant.h"
#include "mpc_plant_data.h"

static double clipped(double x, double low, double high)
{
    return real_min(real_max(x, low), high);
}

/* Linear between points, constant beyond both ends. */
static double at(const double *grid, const double *values, int32_t points, double x)
{
    double result = values[0];
    if (x >= grid[points - 1]) {
        result = values[points - 1];
    } else if (x > grid[0]) {
        int32_t below = 0; /* the last point that is not above x */
        int32_t over = points - 1;
        while ((over - below) > 1) {
            const int32_t middle = (below + over) / 2;
            if (grid[middle] <= x) {
                below = middle;
            } else {
                over = middle;
            }
        }
        const double rise = values[over] - values[below];
        result = values[below] + ((rise / (grid[over] - grid[below])) * (x - grid[below]));
    } else {
        /* below all */
    }
    return result;
}

static double at_soc(const double *values, double soc)
{
    return at(plant_soc_grid, values, PLANT_SOC_POINTS, soc);
}

static double resistance_ohm(double soc, double discharge)
{
    return at_soc((discharge >= 0.0) ? plant_resistance_discharge_ohm : plant_resistance_charge_ohm,
                  soc);
}

/* I = [U - sqrt(U^2 - 4 R P)] / (2 R), in discharge no more than U / (2 R). */
static double current_a(double soc, double power_w)
{
    const double voltage = at_soc(plant_open_circuit_v, soc);
    const double resistance = resistance_ohm(soc, power_w);
    const double root = (voltage * voltage) - (4.0 * resistance * power_w);
    return (voltage - sqrt(real_max(root, 0.0))) / (2.0 * resistance);
}

/* Terminal power that leads from one SOC to another in a second: I (U - R I). */
static double power_to_reach_w(double soc, double soc_end)
{
    const double voltage = at_soc(plant_open_circuit_v, soc);
    const double wanted = (soc - soc_end) * plant_charge_c;
    const double resistance = resistance_ohm(soc, wanted);
    const double current = real_min(wanted, voltage / (2.0 * resistance));
    return current * (voltage - (resistance * current));
}

/* Most power that the battery accepts: its limit, or what just fills it to its upper SOC limit. */
static double charge_limit_w(double soc)
{
    const double filling_w = -power_to_reach_w(soc, plant_soc_max);
    return real_min(plant_battery_charge_max_w, real_max(filling_w, 0.0));
}

/* alpha(T) = 1 + k ((T_hot - T) / span)^e below T_hot, else 1 */
static double cold_factor(double t_cl_degc)
{
    double factor = 1.0;
    if (t_cl_degc < plant_cold_hot_degc) {
        const double below = (plant_cold_hot_degc - t_cl_degc) / plant_cold_span_k;
        factor += plant_cold_k * pow(below, plant_cold_exponent);
    }
    return factor;
}

/* Heat into the coolant in this second, W: no more than brings it to boil, and the cabin takes none
 * from coolant at ambient temperature. */
static double coolant_w(double t_cl_degc, double speed_mps, double fuel_w, double p_eng_w)
{
    const double exhaust_w = plant_exhaust_share * (fuel_w - p_eng_w);
    const double cabin_w = heat_cabin_w(t_cl_degc);
    const double heat_w = fuel_w - p_eng_w - exhaust_w - heat_air_w(t_cl_degc, speed_mps)
                          - heat_radiator_w(t_cl_degc) - cabin_w;
    const double above_k = real_max(t_cl_degc - plant_t_amb_degc, 0.0);
    const double missing_w = -heat_w - (above_k * plant_heat_capacity_j_per_k);
    const double kept_w = heat_w + real_min(real_max(missing_w, 0.0), cabin_w);
    const double room_w = (PLANT_BOILING_DEGC - t_cl_degc) * plant_heat_capacity_j_per_k;
    return kept_w - real_max(kept_w - room_w, 0.0);
}

void mpc_plant_step(mpc_plant_state *state, const mpc_plant_asked *asked, mpc_plant_flows *flows)
{
    const int32_t on = (asked->on_command != 0) ? 1 : 0;
    const int32_t starts = ((on != 0) && (state->engine_on == 0)) ? 1 : 0;
    double p_eng_w = 0.0;
    if (on != 0) {
        const double before_w = (state->engine_on != 0) ? state->p_eng_w : 0.0;
        const double most_w = real_min(plant_engine_max_w, before_w + plant_ramp_w_per_s);
        p_eng_w = clipped(asked->p_command_w, plant_engine_min_w, most_w);
    }
    const double cranking_w = (double)starts * plant_start_energy_j;
    double p_bat_w = ((asked->demand_w + plant_aux_power_w) + cranking_w) - p_eng_w;
    const double accepted_w = charge_limit_w(state->soc);
    double friction_w = 0.0;
    if (p_bat_w < -accepted_w) {
        friction_w = real_min(-accepted_w - p_bat_w, real_max(-asked->demand_w, 0.0));
        p_bat_w += friction_w;
    }
    const double clipped_w = fabs(p_eng_w - asked->p_command_w);
    const double beyond_w =
        real_max(p_bat_w - plant_battery_discharge_max_w, -accepted_w - p_bat_w);
    const double excess_w = real_max(clipped_w, beyond_w);
    const double wanted_w = p_bat_w;
    p_bat_w = real_min(p_bat_w, power_to_reach_w(state->soc, 0.0));
    p_bat_w = real_max(p_bat_w, power_to_reach_w(state->soc, 1.0));
    double fuel_g = 0.0;
    if (on != 0) {
        const double hot_g = at(plant_line_power_w, plant_fuel_g_per_s, PLANT_FUEL_POINTS, p_eng_w);
        fuel_g = cold_factor(state->t_cl_degc) * hot_g;
        fuel_g += (double)starts * plant_start_fuel_g;
    }
    const double fuel_w = (fuel_g * plant_lhv_j_per_kg) * 1e-3;
    const double heat_w = coolant_w(state->t_cl_degc, asked->speed_mps, fuel_w, p_eng_w);
    const double drawn = current_a(state->soc, p_bat_w) / plant_charge_c;
    state->soc = clipped(state->soc - drawn, 0.0, 1.0);
    state->t_cl_degc += heat_w / plant_heat_capacity_j_per_k;
    state->engine_on = on;
    state->p_eng_w = p_eng_w;
    flows->fuel_g = fuel_g;
    flows->p_eng_w = p_eng_w;
    flows->p_bat_w = p_bat_w;
    flows->p_friction_w = friction_w;
    flows->p_missing_w = wanted_w - p_bat_w;
    flows->power_excess_w = (excess_w > PLANT_POWER_TOLERANCE_W) ? excess_w : 0.0;
}
