/* Parameters and tables of one vehicle and one setting: the type of what is generated. */
#ifndef MPC_MODEL_H
#define MPC_MODEL_H

#include <stdint.h>

#include "mpc_config.h"

typedef struct {
    /* piecewise-affine curves: slope and intercept of each piece */
    real_t fuel_slope[MPC_FUEL_PIECES];
    real_t fuel_intercept[MPC_FUEL_PIECES];
    real_t battery_slope[MPC_BATTERY_PIECES];
    real_t battery_intercept[MPC_BATTERY_PIECES];
    real_t alpha_slope[MPC_ALPHA_PIECES];
    real_t alpha_intercept[MPC_ALPHA_PIECES];
    real_t alpha_break[MPC_ALPHA_PIECES]; /* where each piece begins; the first is not used */
    real_t battery_energy_j;              /* of a unit of SOC */
    /* engine */
    real_t engine_max_w;
    real_t engine_min_w;
    real_t lhv_j_per_g;
    real_t fuel_step_w; /* grid of fuel_g_per_s, from 0 */
    real_t fuel_g_per_s[MPC_FUEL_POINTS];
    /* cold engine: 1 + k ((hot - T) / span)^exponent */
    real_t cold_k;
    real_t cold_hot_degc;
    real_t cold_span_k;
    real_t cold_exponent;
    /* coolant */
    real_t heat_capacity_j_per_k;
    real_t exhaust_share;
    real_t ua0_w_per_k;
    real_t ua1_w_per_k_per_mps;
    real_t thermostat_open_degc;
    real_t thermostat_span_k;
    real_t radiator_w_per_k;
    real_t thermostat_w_per_k; /* of the radiator, over the thermostat's span */
    real_t t_amb_degc;
    real_t cabin_heat_w;
    real_t cabin_heat_from_degc;
    real_t cabin_heat_full_degc;
    real_t t_cl_min_degc;
    real_t t_cl_max_degc;
    /* battery; voltage and resistances at the trip's initial SOC belong to the plan */
    real_t soc_grid[MPC_SOC_POINTS];
    real_t open_circuit_v[MPC_SOC_POINTS];
    real_t resistance_charge_ohm[MPC_SOC_POINTS];
    real_t resistance_discharge_ohm[MPC_SOC_POINTS];
    real_t charge_c;
    real_t battery_discharge_max_w;
    real_t battery_charge_max_w;
    real_t soc_min;
    real_t soc_max;
    real_t aux_power_w;
    real_t soc_init;
    real_t t_cl_init_degc;
    real_t plan_voltage_v;
    real_t plan_resistance_discharge_ohm;
    real_t plan_resistance_charge_ohm;
    /* problem */
    real_t soc_reserve;      /* of stages of more than 1 s, above soc_min */
    real_t terminal_soc_low; /* terminal band, already within soc_min..soc_max */
    real_t terminal_soc_high;
    real_t soc_penalty_g; /* quadratic terminal cost instead of the band, where above 0 */
    real_t t_min_degc;    /* coolant limits with their margins */
    real_t t_max_degc;
    real_t slack_g_per_k;
    real_t regularisation;
    /* units of the solver */
    real_t unit_soc;
    real_t unit_t_k;
    real_t unit_power_w;
    real_t unit_fuel_g_per_s;
    /* solver */
    real_t rho;
    real_t inverse_rho;
    real_t rho_equality;
    real_t sigma;
    real_t relaxation;
    /* rules */
    real_t rule_k_soc_w;
    real_t rule_soc_ref;
    real_t rule_on_w;
    real_t rule_off_w;
    real_t rule_power_min_w;
    real_t rule_heat_power_w;
    real_t rule_heat_on_degc;
    real_t rule_heat_off_degc;
    real_t rule_soc_forced;
    int32_t rule_min_on_s;
    /* forecast: demand classes, and the chassis that makes demand of speed */
    real_t class_hard_w;
    real_t class_braking_w;
    real_t mass_kg;
    real_t rotating_mass_factor;
    real_t road_load_a_n;
    real_t road_load_b_n_per_mps;
    real_t road_load_c_n_per_mps2;
    real_t eta_drive;
    real_t eta_regen;
} mpc_model;

extern const mpc_model mpc_par;

#endif
