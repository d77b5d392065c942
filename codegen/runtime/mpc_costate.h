/* Memory of a stage of the costate method, and what its files share; see docs/costate.md. */
#ifndef MPC_COSTATE_H
#define MPC_COSTATE_H

#include <stdint.h>

#include "mpc_config.h"
#include "mpc_rows.h"

/* Net power, the limits of the engine, and the fuel there. */
typedef struct {
    mpc_real net_w;
    mpc_real low_w;
    mpc_real high_w;
    mpc_real low_g_per_s;
    mpc_real high_g_per_s;
} mpc_costate_asked;

/* The program of a stage, SOC and coolant temperature from the origin. */
typedef struct {
    mpc_stage_program of; /* generated, see qpmpc.costate.program */
    mpc_real price_t;     /* cost of a kelvin at its end, of its own and of the next one's growth */
    mpc_real per_end;     /* 1 / t_end */
    mpc_real decay;       /* of the coolant, at least LEAST_DECAY */
    mpc_real least_of_charge; /* responses of a stage that has none of its own now */
    mpc_real least_of_heat;
    mpc_costate_asked asked;        /* where there is a choice of on or off */
    mpc_costate_asked forced_asked; /* where there is none */
    mpc_real width;     /* cost over which on and off are smoothed, g */
    mpc_real per_width; /* 1 / width */
    mpc_real must;   /* 1 where the engine has to run all the time, else 0 */
    mpc_real cannot; /* 1 where it must not, else 0 */
    mpc_real forced; /* share of the seconds without a choice in a stage that has both, and the rest
                      */
    mpc_real free;
#if MPC_STARTS
    mpc_real rises; /* of the on-share */
#endif
} mpc_costate_program;

/* Engine power with its fuel and the internal power of the battery. */
typedef struct {
    mpc_real power_w;
    mpc_real fuel_g_per_s;
    mpc_real internal_w;
} mpc_drive;

/* The smoothed dual at some multipliers. */
typedef struct {
    mpc_real charge; /* lambda at the end of the stage, g */
    mpc_real heat;   /* multiplier of its coolant limits, g/K */
    mpc_real nu;
    mpc_real soc;
    mpc_real t_cl_k;
    mpc_real of_charge; /* derivatives of the change of SOC to lambda, of that to nu, */
    mpc_real cross;
    mpc_real of_heat; /* of the coolant's heat to nu */
    mpc_real share;   /* sigma */
    mpc_drive on;     /* while on, where there is a choice */
    mpc_drive forced; /* where there is none, in a stage that has both */
    mpc_real on_g;    /* cost of the seconds with a choice on, off, and of a start */
    mpc_real off_g;
    mpc_real forced_g; /* what the seconds without a choice add */
#if MPC_STARTS
    mpc_real start_g;
#endif
} mpc_costate_dual;

/* Derivatives of the change of SOC to lambda, of that to nu, of the coolant's heat to nu. */
typedef struct {
    mpc_real charge;
    mpc_real cross;
    mpc_real heat;
} mpc_responses;

/* What a stage answers to its prices, on the way. */
typedef struct {
    mpc_responses by_switch;
    mpc_responses always;
    mpc_real switch_charge; /* change of SOC, and heat, by on instead of off */
    mpc_real switch_heat;
    mpc_real spent_w; /* without a choice: internal power of the battery, and heat */
    mpc_real heat;
} mpc_costate_answer;

/* A term of a running sum, see mpc_costate_funnel.c. */
typedef struct {
    mpc_real offset;
    mpc_real response;
    mpc_real limit[2]; /* of the sum: lower, upper */
    mpc_real bound[2]; /* of the price, by these limits, on the way */
    mpc_real decay;
    mpc_real price; /* found */
} mpc_costate_term;

typedef struct {
    mpc_stage_road road;
    mpc_costate_program p;
    mpc_costate_dual dual[2]; /* where the search is, and what it tries */
    mpc_costate_answer answer;
    mpc_real x[MPC_VARS];     /* SOC and coolant temperature from the origin */
    mpc_real y[MPC_ROWS];     /* multipliers of the SOC and the coolant limits */
    mpc_real goal_charge;     /* aim of a round */
    mpc_real goal_heat;
} mpc_stage;

/* The search. */
typedef struct {
    mpc_costate_term
        term[MPC_STAGES + 2]; /* after the last, one that ends the walk, one for waste */
    mpc_real value[2];        /* of the duals, and the part that no stage has */
    mpc_real constant_g[2];
    mpc_real share; /* of the way to the aim that is tried next */
    int32_t streak; /* rounds in a row that rose */
    int32_t here;   /* which dual the search is at */
    mpc_real certificate_g;
} mpc_search;

#endif
