/* What the files of the controller offer each other. */
#ifndef MPC_PARTS_H
#define MPC_PARTS_H

#include "mpc.h"

typedef struct {
    real_t p_eng_w;
    int32_t engine_on;
} mpc_command;

/* mpc_maps.c: maps of engine and battery */
real_t map_fuel_g_per_s(real_t p_eng_w);
real_t map_cold_factor(real_t t_cl_degc);
real_t map_charge_limit_w(real_t soc);
real_t map_discharge_limit_w(real_t soc);
real_t map_planned_internal_w(real_t power_w);
real_t pwa_alpha(real_t t_cl_degc);
real_t pwa_alpha_slope(real_t t_cl_degc);
real_t pwa_battery(real_t power_w);

/* mpc_qp.c: values of the quadratic program */
void qp_road(mpc_state *state, const mpc_in *in);
void qp_move_origin(mpc_state *state, real_t soc, real_t t_cl_degc);
void qp_linearise_cold(mpc_state *state);
void qp_linearise_about_plan(mpc_state *state);
void qp_update(mpc_state *state);
real_t qp_relaxation_gap(const mpc_stage *stage);

/* mpc_iterate.c: the iterate */
void iterate_clear(mpc_state *state);
void iterate_shift(mpc_state *state, int32_t by);
void iterate_to_solver_units(mpc_state *state);
void iterate_to_si_units(mpc_state *state);
int32_t iterate_usable(const mpc_state *state);
void iterate_keep(mpc_state *state);
int32_t iterate_restore(mpc_state *state);

/* The solver. solver_claim: this controller is the one that uses it from now on. solver_start:
 * takes values and iterate, in solver units. solver_iterate: moves the iterate on; returns 0 if the
 * solver itself says that nothing came of it. */
void solver_claim(const mpc_state *state);
void solver_start(mpc_state *state);
int32_t solver_iterate(mpc_state *state, int32_t count);

/* mpc_safety.c, mpc_rules.c, mpc_check.c */
mpc_command safety_admissible(mpc_command wish, const mpc_measured *seen);
mpc_command rules_decide(rule_memory *memory, const mpc_measured *seen);
int32_t check_measured(mpc_measured *good, const mpc_in *in);
int32_t check_second(real_t demand_w, real_t speed_mps);
int32_t check_preview(const mpc_in *in);

#endif
