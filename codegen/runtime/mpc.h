/* Multi-horizon predictive energy and thermal management of a hybrid car: public interface.
 *
 * One controller is one `mpc_state`, in memory of the caller. Nothing else is written, so any
 * number of controllers may run side by side. No allocation, no recursion, no input or output.
 *
 *     mpc_init(&state);
 *     while (mpc_depart(&state, &in) > 0) { }      optional, before the trip: see below
 *     every second: fill in `in`; mpc_step(&state, &in, &out); apply `out`
 *
 * Every call of mpc_step and of mpc_depart does at most MPC_ITERATIONS solver iterations and one
 * factorisation: a fixed amount of arithmetic.
 *
 * Without a departure the solver starts cold inside mpc_step: the rules drive until
 * MPC_WARM_UP_STEPS seconds' iterations have been spent. After a failure of the solver the next
 * second starts from the last usable solution; after several in a row it starts cold.
 */
#ifndef MPC_H
#define MPC_H

#include <stdint.h>

#include "mpc_config.h"
#include "mpc_state.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Inputs at the start of a second. Power in W, speed in m/s, temperature in degC. */
typedef struct {
    mpc_real soc;       /* measured state of charge, 0..1 */
    mpc_real t_cl_degc; /* measured coolant temperature */
    mpc_real demand_w;  /* power demand of the coming second, negative when braking */
    mpc_real speed_mps; /* mean speed of the coming second */
    /* accurate preview of the coming seconds; the first is the coming second itself */
    mpc_real short_demand_w[MPC_SHORT];
    mpc_real short_speed_mps[MPC_SHORT];
    /* statistics of the trip beyond, block by block, in each block class by class (hard driving,
     * easy driving, braking): seconds, mean of the net power P0 = demand + auxiliaries (each
     * second clipped at the battery's charge limit before the mean is taken), mean speed, mean of
     * the internal battery power l(P0) with the engine off, share of the seconds in which the engine
     * must run (P0 beyond the battery's limit, or too fast for an engine that is off; likewise the
     * seconds after the first of such ones, until a shortest run has ended), means of P0
     * and l(P0) over the other seconds (over all, where there are none); and how often the demand
     * rises into that class or past it, which matters where starts of the engine cost something (0
     * if it is not known: they are then counted over the short horizon alone). 0 seconds where
     * nothing is left. mpc_forecast.h makes the preview from demand and speed of the trip. */
    mpc_real long_duration_s[MPC_LONG];
    mpc_real long_net_w[MPC_LONG];
    mpc_real long_speed_mps[MPC_LONG];
    mpc_real long_internal_off_w[MPC_LONG];
    mpc_real long_must_share[MPC_LONG];
    mpc_real long_free_net_w[MPC_LONG];
    mpc_real long_free_internal_off_w[MPC_LONG];
    mpc_real long_rises[MPC_LONG];
    /* of the last class of each block, the others are not read: energy, J, by which SOC at the end of
     * the block stays off its lower and its upper limit, because it swings inside the block and the
     * next (0 if it is not known) */
    mpc_real long_fall_j[MPC_LONG];
    mpc_real long_rise_j[MPC_LONG];
    /* energy, J, by which SOC at the end of the MPC_SHORT seconds stays off its upper limit: room for
     * the braking beyond (0 if it is not known, and where they reach the arrival) */
    mpc_real short_rise_j;
    int32_t short_count; /* seconds of the short preview before arrival, 1..MPC_SHORT */
    int32_t second;      /* clock: seconds since departure */
    int32_t engine_on;   /* measured: 1 if the engine ran in the last second, else 0 */
#if MPC_LEARNING
    mpc_real fuel_g; /* measured: fuel injected in the last second */
#endif
} mpc_in;

/* Rung of the ladder that the command comes from. */
enum {
    MPC_OPTIMISED = 0,    /* the plan of this second */
    MPC_SHIFTED_PLAN = 1, /* a plan of at most MPC_PLAN_VALID_STEPS seconds ago */
    MPC_RULES = 2         /* rules that need no plan */
};

/* What was wrong in a second: bits of mpc_out.flags. The first two and the last alone cost no plan. */
enum {
    MPC_BAD_MEASUREMENT = 1, /* the model's prediction from the last good one is used */
    MPC_BAD_PREVIEW = 2,     /* the last good one is used as long as it reaches */
    MPC_SOLVER_FAILED = 4,   /* no usable solution */
    MPC_WARMING_UP = 8,      /* the solver has not converged yet since a cold start */
    MPC_BAD_CLOCK = 16, /* a second again, or one that cannot be: then seconds are counted on */
    MPC_BAD_STATE = 32, /* memory was not initialised, or was corrupted; it is initialised */
    MPC_BAD_CALIBRATION = 64 /* state->calibration is refused; the last good one is in use */
};

typedef struct {
    mpc_real p_eng_w;  /* engine power; 0 with the engine off */
    mpc_real on_share; /* planned on-share of the coming second; 0 if there is no new plan */
#if MPC_COSTATE
    mpc_real certificate_g; /* by how much the plan may at most be improved; 0 without a new one */
#else
    mpc_real relaxation_gap; /* relative slack of the relaxed curves; 0 if there is no new plan */
#endif
    int32_t engine_on; /* 0 or 1 */
    int32_t rung;
    int32_t flags;
    int32_t iterations;  /* of the solver in this call */
    int32_t wrong_entry; /* of a calibration that is refused, MPC_CAL_...: out of its bounds or, of
                            two that contradict each other, the lower one; else -1 */
} mpc_out;

/* Set a defined state: no plan, cold solver, rules reset, the calibration that was generated.
 *
 * state->calibration, see mpc_calibration.h, may be written at any time, by a calibration tool too,
 * with numbers of the precision of mpc_real. Each second it is taken over as a whole if every entry
 * lies in its bounds and no two contradict each other; if not, that is flagged and the one before
 * stays in use. */
void mpc_init(mpc_state *state);

/* Do one slice of the departure: a cold solve, linearised MPC_DEPARTURE_LINEARISATIONS times.
 *
 * To be called after mpc_init, with the same `in`, until it returns 0. Returns 1 while slices
 * remain and -1, having done nothing, on bad input or without mpc_init. Once mpc_step has been
 * called there is nothing left to do: it returns 0.
 */
int32_t mpc_depart(mpc_state *state, const mpc_in *in);

/* Decide one second. Whatever `in` holds, `out` is finite and in range; returns out->flags. */
int32_t mpc_step(mpc_state *state, const mpc_in *in, mpc_out *out);

/* Copy the last solution in SI units, for diagnosis: MPC_STAGES rows of MPC_VARS variables in the
 * order of MPC_VAR_SOC and so on, and MPC_STAGES rows of MPC_ROWS duals (g of fuel per unit). */
void mpc_plan(const mpc_state *state, mpc_real *x, mpc_real *duals);

/* Layout of this build, for callers in other languages to check theirs: version of this
 * interface, sizeof mpc_real, mpc_in, mpc_out, mpc_state, then MPC_SHORT, MPC_LONG, MPC_VARS,
 * MPC_ROWS, MPC_ITERATIONS, offset of mpc_in.short_count, of mpc_out.engine_on, of
 * mpc_state.calibration, MPC_CAL_ENTRIES. */
#define MPC_ABI_VERSION 8
#define MPC_ABI_ENTRIES 14
int32_t mpc_abi(int32_t entry);

#ifdef __cplusplus
}
#endif
#endif
