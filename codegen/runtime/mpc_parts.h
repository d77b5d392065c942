/* Functions that the files of the controller share. */
#ifndef MPC_PARTS_H
#define MPC_PARTS_H

#include "mpc.h"

typedef struct {
    mpc_real p_eng_w;
    int32_t engine_on;
} mpc_command;

/* What a second's rates cost, duals of SOC and coolant included: g per g of fuel of the hot engine, per
 * J of engine work, per J from the battery's store. */
typedef struct {
    mpc_real fuel;
    mpc_real p_eng;
    mpc_real internal;
} mpc_prices;

/* A second with the engine on, at its least-cost power, against the same with it off. */
typedef struct {
    mpc_real power_w;
    mpc_real gain_w; /* of the battery's store */
    mpc_real dearer; /* g at the plan's prices; of a second behind arrival nothing by costates */
} mpc_going;

/* mpc_maps.c: maps of engine and battery */
mpc_real mpc_map_fuel_g_per_s(mpc_real p_eng_w);
mpc_real mpc_map_cold_factor(mpc_real t_cl_degc);
mpc_real mpc_map_charge_limit_w(mpc_real soc, mpc_real soc_max);
mpc_real mpc_map_energy_j(mpc_real soc);
mpc_real mpc_map_power_to_reach_w(mpc_real soc, mpc_real soc_end);
mpc_real mpc_map_current_a(mpc_real soc, mpc_real power_w);
mpc_real mpc_map_planned_internal_w(mpc_real power_w);
mpc_real mpc_pwa_alpha(mpc_real t_cl_degc);
mpc_real mpc_pwa_alpha_slope(mpc_real t_cl_degc);
mpc_real mpc_pwa_battery(mpc_real power_w);

/* mpc_stages.c: the stages of a second */
void mpc_stages_take(mpc_state *state, const mpc_in *in);
void mpc_stages_move_up(mpc_state *state, int32_t by);
void mpc_stages_move_origin(mpc_state *state, mpc_real soc, mpc_real t_cl_degc);
void mpc_stages_expand_cold(mpc_state *state);
void mpc_stages_follow_plan(mpc_state *state);
void mpc_stages_expand_about_plan(mpc_state *state);

/* The method of planning, mpc_qp_method.c or mpc_costate_solve.c and mpc_costate_plan.c.
 * mpc_method_claim: makes this controller its user from now on. mpc_method_check: whether its own
 * memory is sound. mpc_method_start: makes the values of a second and starts at the iterate.
 * mpc_method_iterate: iterates; returns 0 if the method itself reports a failure.
 * mpc_method_finish: puts the plan into the iterate; returns whether it is usable.
 * mpc_method_plan: on-share and mean power of the seconds ahead; returns the power that the coming
 * one gets at least, whatever its on-share. */
void mpc_method_claim(const mpc_state *state);
int32_t mpc_method_check(const mpc_state *state);
void mpc_method_start(mpc_state *state);
int32_t mpc_method_iterate(mpc_state *state, int32_t count);
int32_t mpc_method_finish(mpc_state *state, int32_t solved);
mpc_real mpc_method_plan(const mpc_state *state, mpc_real *on_share, mpc_real *p_eng_w);
void mpc_method_report(const mpc_state *state, mpc_out *out);

/* mpc_qp.c: values of the quadratic program */
void mpc_qp_update(mpc_state *state);
mpc_real mpc_qp_relaxation_gap(const mpc_state *state);

/* mpc_polish.c: a second at the plan's prices. mpc_polish_power_w: engine power of second k, of a plan
 * in SI units; planned_w if a charge has no price. mpc_polish_going: that second with the engine on. */
mpc_prices mpc_polish_prices(const mpc_state *state);
mpc_real mpc_polish_power_w(const mpc_state *state, const mpc_prices *prices, int32_t k,
                            mpc_real planned_w);
mpc_going mpc_polish_going(const mpc_state *state, const mpc_prices *prices, int32_t k);

/* mpc_full_battery.c: the most power of the coming second for which the battery has room. */
mpc_real mpc_full_battery_w(const mpc_state *state, const mpc_prices *prices);

/* mpc_coming_second.c: the power that the coming second gets at least by the rules below, of the on-shares
 * of the seconds ahead as they will be realised, and of these with the engine on; of the first alone where
 * a start costs nothing. room_w is that of mpc_full_battery.c. */
mpc_real mpc_coming_least_w(const mpc_state *state, const mpc_prices *prices,
                            const mpc_real *on_share, const mpc_going *second, mpc_real room_w);

/* Where the coming second runs beside the plan, at its least-cost power power_w; 0
 * elsewhere. mpc_empty_battery.c: where the battery or the ramp needs the engine, with the ramp's power
 * at least. mpc_last_run.c: where a run goes on for all that the plan still wants, or begins for it in
 * time. mpc_battery_run.c: where one goes on or begins for what the battery lacks in the seconds ahead.
 * mpc_short_run.c: where one that is shorter than it may be begins before its time. These three of the
 * seconds of the short horizon with the engine on. mpc_heating_run.c: where a run goes on for the heat
 * that the coolant lacks, or one second gives all of it; by whether the plan runs the engine in it. */
mpc_real mpc_empty_battery_w(const mpc_state *state, mpc_real power_w, mpc_real ramp_w);
mpc_real mpc_last_run_w(const mpc_state *state, const mpc_prices *prices, const mpc_going *now);
mpc_real mpc_last_start_w(const mpc_state *state, const mpc_prices *prices,
                          const mpc_going *second);
mpc_real mpc_battery_run_w(const mpc_state *state, const mpc_real *on_share,
                           const mpc_going *second);
mpc_real mpc_short_run_w(const mpc_state *state, const mpc_prices *prices, const mpc_real *on_share,
                         const mpc_going *second);
mpc_real mpc_heating_run_w(const mpc_state *state, const mpc_prices *prices, mpc_real power_w,
                           int32_t is_planned);

/* mpc_ramp.c: what the ramp asks of the coming second */
mpc_real mpc_ramp_least_w(const mpc_state *state);

/* mpc_realise.c: from on-shares to on or off */
mpc_command mpc_realise(const mpc_state *state);

/* mpc_floor.c: coolant to be had in good time */
void mpc_floor_find(mpc_state *state, mpc_real soc);

/* mpc_iterate.c: the iterate */
void mpc_iterate_clear(mpc_state *state);
void mpc_iterate_shift(mpc_state *state, int32_t by);
int32_t mpc_iterate_usable(const mpc_state *state);
void mpc_iterate_keep(mpc_state *state);
int32_t mpc_iterate_restore(mpc_state *state);

/* The algorithm of the QP. mpc_solver_claim: makes this controller its user from now on. mpc_solver_start:
 * takes values and iterate, in solver units. mpc_solver_iterate: iterates; returns 0 if the
 * algorithm itself reports a failure. */
void mpc_solver_claim(const mpc_state *state);
void mpc_solver_start(mpc_state *state);
int32_t mpc_solver_iterate(mpc_state *state, int32_t count);

/* mpc_calibration.c. mpc_calibration_take: takes over the one from outside; returns the entry that is
 * wrong, -1 if none. mpc_calibration_check: whether the one in use is sound. */
int32_t mpc_calibration_take(mpc_state *state);
int32_t mpc_calibration_check(const mpc_calibration *cal);

/* mpc_safety.c, mpc_rules.c, mpc_check.c */
mpc_command mpc_safety_admissible(mpc_command wish, const mpc_measured *seen,
                                  const mpc_calibration *cal);
mpc_command mpc_rules_decide(mpc_rule_memory *memory, const mpc_measured *seen,
                             const mpc_calibration *cal);
int32_t mpc_check_state(const mpc_state *state);
int32_t mpc_check_measured(mpc_watch *watch, const mpc_calibration *cal, const mpc_in *in,
                           int32_t *elapsed);
int32_t mpc_check_second(mpc_real demand_w, mpc_real speed_mps);

/* mpc_preview.c */
int32_t mpc_preview_first(mpc_heard *heard, const mpc_in *in);
int32_t mpc_preview_check(mpc_heard *heard, const mpc_in *in, int32_t elapsed);
int32_t mpc_preview_check_kept(const mpc_state *state);

#endif
