/* Memory of one controller. Its contents are private but for `calibration`, see mpc_init. */
#ifndef MPC_STATE_H
#define MPC_STATE_H

#include <stdint.h>

#include "mpc_calibration.h"
#include "mpc_config.h"
#include "mpc_rows.h"
#if MPC_COSTATE
#include "mpc_costate.h"
#else
#if !MPC_SOLVER_OSQP
#include "mpc_rows_factor.h"
#endif

typedef struct {
    mpc_stage_road road;
    mpc_stage_matrix a;
    mpc_stage_bounds b;
    mpc_real hessian[MPC_VARS]; /* diagonal */
    mpc_real q[MPC_VARS];
    mpc_real column[MPC_VARS]; /* SI value = column * solver value */
    mpc_real row[MPC_ROWS];
    mpc_real x[MPC_VARS]; /* in SI units between steps, in solver units while solving; SOC and
                           coolant temperature from the origin */
    mpc_real y[MPC_ROWS];
#if !MPC_SOLVER_OSQP
    mpc_real z[MPC_ROWS];
    mpc_real work[MPC_VARS];
    mpc_stage_factor factor;
#endif
} mpc_stage;
#endif

/* The iterate that a solve starts from, in SI units. */
typedef struct {
    mpc_real x[MPC_VARS];
    mpc_real y[MPC_ROWS];
} mpc_stage_iterate;

/* Memory of the rules. */
typedef struct {
    int32_t power_request;
    int32_t heat_request;
} mpc_rule_memory;

/* The measured values in use: the last good ones; and what is known of the engine from those and
 * the commands before. */
typedef struct {
    mpc_real soc;
    mpc_real t_cl_degc;
    mpc_real demand_w;
    mpc_real speed_mps;
    mpc_real p_eng_before_w; /* power in the last second; the greatest while on if not known */
    int32_t engine_on;
    int32_t engine_for_s; /* since it was started or stopped */
#if MPC_LEARNING
    mpc_real fuel_g; /* injected in the last second; negative if that is not known */
#endif
} mpc_measured;

#if MPC_LEARNING
enum {
    MPC_LATE = 3,    /* seconds that fuel may be measured late, at most */
    MPC_UNKNOWNS = 5 /* idle, slope, and what is late by so many seconds or more */
};

/* Double in single precision too: sums over a quarter of an hour beside what the map counts in them,
 * and their determinant, need more digits than a float has. */
typedef double mpc_wide;

/* What is known of the fuel map, see mpc_learned.c: the last seconds, sums over all before; and the
 * curve that is made of them. Fuel is a share of that at full power. */
typedef struct {
    int32_t left_s;              /* in which fuel of the engine, now off, may still be measured */
    int32_t void_s;              /* that teach nothing */
    mpc_real fuel[MPC_LATE + 1]; /* the map's, starts included, in the last second and before */
    mpc_real cold[MPC_LATE + 1]; /* cold multiplier, 0 with the engine off */
    mpc_real load[MPC_LATE + 1]; /* the same times the share of full power */
    mpc_wide square[MPC_UNKNOWNS][MPC_UNKNOWNS];
    mpc_wide product[MPC_UNKNOWNS];
    mpc_real slope[MPC_FUEL_PIECES];
    mpc_real intercept[MPC_FUEL_PIECES];
    mpc_real idle_g_per_s;
    mpc_real chord_g_per_j;
} mpc_learned;
#endif

/* Memory of the checks of measurements. */
typedef struct {
    mpc_measured good;
    mpc_real command_w; /* last command */
    int32_t command_on;
    int32_t soc_since_s; /* since the last good measurement */
    int32_t t_cl_since_s;
    int32_t clock; /* `second` of the last call */
    int32_t has_clock;
} mpc_watch;

/* The last preview received that the car could drive, to compare the next one with. */
typedef struct {
    mpc_real short_demand_w[MPC_SHORT];
    mpc_real long_duration_s[MPC_LONG];
    mpc_real long_net_w[MPC_LONG];
    mpc_real long_internal_off_w[MPC_LONG];
    int32_t short_count;
    int32_t age; /* seconds since then; MPC_NO_PLAN if there is none */
} mpc_heard;

typedef struct {
    uint32_t magic; /* tells an initialised state from any other memory, as does magic_end */
    mpc_calibration calibration; /* written from outside */
    mpc_calibration cal;         /* in use: the last good one */
    mpc_stage stage[MPC_STAGES];
    mpc_stage_iterate kept[MPC_STAGES]; /* to go back to if the solve fails */
    /* Origin of SOC and coolant temperature: the state at the start of the horizon. Small numbers
     * leave the digits of single precision to the changes within the plan. */
    mpc_real origin_soc;
    mpc_real origin_t_cl_degc;
    mpc_real highest_floor_degc; /* of any stage */
#if MPC_COSTATE
    mpc_search search;
#else
    mpc_real cost; /* of the solver, in units per g */
#endif
    mpc_real old_on_share[MPC_SHORT]; /* last usable plan */
    mpc_real old_p_eng_w[MPC_SHORT];
    mpc_real old_least_w;  /* of its first second, for ramp, battery, heat or a run that goes on */
    int32_t old_age;       /* steps since then; MPC_NO_PLAN if there is none */
    int32_t old_arrival_s; /* seconds of it before arrival; MPC_SHORT if that is beyond */
    int32_t old_fast_s;    /* seconds of it before one too fast for an engine that is off;
                              MPC_SHORT if there is none */
    int32_t road_age;      /* seconds since the last good preview; MPC_NO_PLAN if there is none */
    int32_t phase;
    int32_t failures;             /* of the solver, in a row */
    int32_t solves;               /* since the last cold start, up to MPC_WARM_UP_STEPS */
    int32_t is_under_way;         /* the first step has been made */
    int32_t depart_linearisation; /* done of the departure */
    int32_t depart_left;          /* iterations left of the current linearisation */
    mpc_watch watch;
    mpc_heard heard;
    mpc_rule_memory rules;
#if MPC_LEARNING
    mpc_learned learned;
#endif
    uint32_t magic_end;
} mpc_state;

enum {
    MPC_PHASE_COLD = 0,      /* no iterate */
    MPC_PHASE_DEPARTING = 1, /* iterate in solver units, matrix of the departure */
    MPC_PHASE_RUNNING = 2    /* iterate of a finished solve, in SI units */
};
#define MPC_NO_PLAN 1000000
#define MPC_MAGIC 0x51504D43u

#endif
