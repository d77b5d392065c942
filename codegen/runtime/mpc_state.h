/* Memory of one controller. Its contents are private; only its size concerns the caller. */
#ifndef MPC_STATE_H
#define MPC_STATE_H

#include <stdint.h>

#include "mpc_config.h"
#include "mpc_rows.h"
#if !MPC_SOLVER_OSQP
#include "mpc_rows_factor.h"
#endif

typedef struct {
    stage_road road;
    stage_matrix a;
    stage_bounds b;
    real_t hessian[MPC_VARS]; /* diagonal */
    real_t q[MPC_VARS];
    real_t column[MPC_VARS]; /* SI value = column * solver value */
    real_t row[MPC_ROWS];
    real_t x[MPC_VARS]; /* in SI units between steps, in solver units while solving; SOC and
                           coolant temperature from the origin */
    real_t y[MPC_ROWS];
#if !MPC_SOLVER_OSQP
    real_t z[MPC_ROWS];
    real_t work[MPC_VARS];
    stage_factor factor;
#endif
} mpc_stage;

/* The iterate that a solve starts from, in SI units. */
typedef struct {
    real_t x[MPC_VARS];
    real_t y[MPC_ROWS];
} stage_iterate;

/* Memory of the rules. */
typedef struct {
    int32_t power_request;
    int32_t heat_request;
    int32_t on_for_s;
} rule_memory;

/* The measured values that count: the last good ones. */
typedef struct {
    real_t soc;
    real_t t_cl_degc;
    real_t demand_w;
    real_t speed_mps;
} mpc_measured;

typedef struct {
    mpc_stage stage[MPC_STAGES];
    stage_iterate kept[MPC_STAGES]; /* to go back to if the solve fails */
    /* Where SOC and coolant temperature are counted from: the state at the start of the horizon.
     * Small numbers keep the digits of single precision for what the plan changes. */
    real_t origin_soc;
    real_t origin_t_cl_degc;
    real_t cost;                     /* of the solver, in units per g */
    real_t old_on_share[MPC_SHORT];  /* last usable plan */
    real_t old_p_eng_w[MPC_SHORT];
    int32_t old_age;                 /* steps since then; MPC_NO_PLAN if there is none */
    int32_t phase;
    int32_t failures;                /* of the solver, in a row */
    int32_t solves;                  /* since the last cold start, up to MPC_WARM_UP_STEPS */
    int32_t is_under_way;            /* the first step has been made */
    int32_t depart_linearisation;    /* done of the departure */
    int32_t depart_left;             /* iterations left of the linearisation at hand */
    mpc_measured good;
    rule_memory rules;
} mpc_state;

enum {
    PHASE_COLD = 0,      /* no iterate */
    PHASE_DEPARTING = 1, /* iterate in solver units, matrix of the departure */
    PHASE_RUNNING = 2    /* iterate of a finished solve, in SI units */
};
#define MPC_NO_PLAN 1000000

#endif
