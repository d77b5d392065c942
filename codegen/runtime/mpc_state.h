/* Memory of one controller. Its contents are private; only its size concerns the caller. */
#ifndef MPC_STATE_H
#define MPC_STATE_H

#include <stdint.h>

#include "mpc_config.h"

/* Variables of a stage. The order is that of elimination: states last, because only they couple
 * a stage with the next, and before them what no state equation contains. */
enum {
    VAR_SLACK = 0,    /* K beyond the coolant limits */
    VAR_ON = 1,       /* share of the stage with the engine on */
    VAR_INTERNAL = 2, /* G, mean internal battery power, W */
    VAR_FUEL = 3,     /* F, mean fuel rate of a hot engine, g/s */
    VAR_P_ENG = 4,    /* E, mean engine power, W */
    VAR_SOC = 5,      /* at the end of the stage */
    VAR_T_CL = 6,     /* degC, at the end of the stage */
    MPC_VARS = 7
};

/* Rows of a stage. */
enum {
    ROW_SOC = 0,
    ROW_T_CL = 1,
    ROW_FUEL = 2,
    ROW_BATTERY = ROW_FUEL + MPC_FUEL_PIECES,
    ROW_P_MAX = ROW_BATTERY + MPC_BATTERY_PIECES,
    ROW_P_MIN = ROW_P_MAX + 1,
    ROW_BOX_SOC = ROW_P_MAX + 2,
    ROW_BOX_ON = ROW_P_MAX + 3,
    ROW_T_MIN = ROW_P_MAX + 4,
    ROW_T_MAX = ROW_P_MAX + 5,
    ROW_SLACK = ROW_P_MAX + 6,
    MPC_ROWS = ROW_P_MAX + 7
};

/* Matrix rows of a stage; entries in the order named. Rows with one entry are 1 after scaling. */
typedef struct {
    real_t soc[3];                          /* soc, soc before, internal */
    real_t t_cl[4];                         /* t_cl, t_cl before, p_eng, fuel */
    real_t fuel[MPC_FUEL_PIECES][3];        /* fuel, p_eng, on */
    real_t battery[MPC_BATTERY_PIECES][3];  /* internal, p_eng, on */
    real_t p_max[2];                        /* p_eng, on */
    real_t p_min[2];                        /* p_eng, on */
    real_t t_min[2];                        /* t_cl, slack */
    real_t t_max[2];                        /* t_cl, slack */
} stage_matrix;

/* Bounds other than 0, which the others have: soc = 0, fuel >= 0, p_max <= 0, slack >= 0. */
typedef struct {
    real_t t_cl; /* equal */
    real_t battery_low[MPC_BATTERY_PIECES];
    real_t p_min_low;
    real_t soc_low;
    real_t soc_high;
    real_t on_low;
    real_t on_high;
    real_t t_min_low;
    real_t t_max_high;
} stage_bounds;

#if !MPC_SOLVER_OSQP
enum {
    COUPLED = 2, /* first variable that elimination of the stage before touches */
    COUPLED_COUNT = 5
};

/* Factor of a stage: L D L' with unit L, of which only what can differ from 0 is kept. */
typedef struct {
    real_t slack_t;                             /* column of slack: t_cl */
    real_t on[3];                               /* column of on: internal, fuel, p_eng */
    real_t dense[COUPLED_COUNT][COUPLED_COUNT]; /* below the diagonal, from VAR_INTERNAL on */
    real_t before_soc[2];                       /* column of soc before: internal, soc */
    real_t before_t[COUPLED_COUNT];             /* column of t_cl before */
    real_t inverse_d[MPC_VARS];
} stage_factor;
#endif

typedef struct {
    real_t duration_s; /* 0: masked, the stage passes the state on and costs nothing */
    real_t net_w;
    real_t speed_mps;
    real_t internal_off_w; /* of the battery, engine off */
    /* where the coolant's heat and the thermostat are expanded */
    real_t about_t_degc; /* of alpha */
    real_t about_fuel_g_per_s;
    real_t about_p_eng_w;
    real_t about_start_degc;
    real_t about_end_degc;
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
    real_t origin_t_degc;
    real_t cost;                     /* of the solver, in units per g */
    real_t old_sigma[MPC_SHORT];     /* last usable plan */
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
