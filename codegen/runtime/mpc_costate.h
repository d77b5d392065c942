/* Memory of a stage of the costate method, and what its files share; see docs/costate.md. */
#ifndef MPC_COSTATE_H
#define MPC_COSTATE_H

#include <stdint.h>

#include "mpc_config.h"
#include "mpc_rows.h"

/* Seconds of a stage: those with a choice of on or off and, in a longer stage that has both, those
 * in which the engine must run. */
enum { MPC_FREE = 0, MPC_FORCED = 1, MPC_PARTS = 2 };

typedef struct {
    mpc_real share; /* of the stage */
    mpc_real net_w;
    mpc_real low_w; /* limits of the engine, and the fuel there */
    mpc_real high_w;
    mpc_real low_g_per_s;
    mpc_real high_g_per_s;
} mpc_costate_part;

/* The program of a stage, SOC and coolant temperature from the origin. */
typedef struct {
    mpc_stage_program of; /* generated, see qpmpc.costate.program */
    mpc_real price_t;     /* cost of a kelvin at its end, of its own and of the next one's growth */
    mpc_real per_end;     /* 1 / t_end */
    mpc_real decay;       /* of the coolant, at least LEAST_DECAY */
    mpc_real least_of_charge; /* responses of a stage that has none of its own now */
    mpc_real least_of_heat;
    mpc_costate_part part[MPC_PARTS];
    mpc_real off_charge; /* SOC that the free seconds take with the engine off */
    mpc_real widest;     /* cost over which on and off are smoothed, g: at most, */
    mpc_real width;      /* and W */
    mpc_real per_width;  /* 1 / width */
    mpc_real must;       /* 1 where the engine has to run all the time, else 0 */
    mpc_real cannot;     /* 1 where it must not, else 0 */
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
    mpc_real of_heat;           /* of the coolant's heat to nu */
    mpc_real share;             /* sigma */
    mpc_drive drive[MPC_PARTS]; /* while on */
    mpc_real on_g[MPC_PARTS];   /* cost of the parts with the engine on, */
    mpc_real off_g;             /* of the free one with it off, and of a start */
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

/* What a part answers to its prices with the engine on: SOC that it takes, heat in the coolant. */
typedef struct {
    mpc_responses to_prices;
    mpc_real charge;
    mpc_real heat;
} mpc_costate_answer;

/* A term of a running sum, see mpc_costate_funnel.c. */
typedef struct {
    mpc_real offset;
    mpc_real response;
    mpc_real limit[2]; /* of the sum: lower, upper */
    mpc_real price;    /* found */
} mpc_costate_term;

/* Terms of one that decays, see mpc_costate_scan.c: one of them, or those of a stretch. */
typedef struct {
    mpc_real offset;
    mpc_real response;
    mpc_real decay;
    mpc_real limit; /* of the sum after the last of them */
    mpc_real side;  /* 1 a lower limit, -1 an upper one, 0 none */
    mpc_real price; /* of a stretch whose limit is met, */
    mpc_real jump;  /* that less the next one's, decayed: the limit's multiplier; */
    int32_t at;     /* its last term, from 1 */
} mpc_costate_stretch;

typedef struct {
    mpc_stage_road road;
    mpc_costate_program p;
    mpc_costate_dual dual[2];             /* where the search is, and what it tries */
    mpc_costate_answer answer[MPC_PARTS]; /* on the way */
    mpc_real x[MPC_VARS];                 /* SOC and coolant temperature from the origin */
    mpc_real y[MPC_ROWS];                 /* multipliers of the SOC and the coolant limits */
    mpc_real goal_charge;                 /* aim of a round */
    mpc_real given_heat; /* multiplier of a coolant limit that is given up, else 0 */
} mpc_stage;

/* What a round of the search moves: all multipliers, those of SOC, those of the coolant. */
#define MPC_MOVES_BOTH 0
#define MPC_MOVES_CHARGE 1
#define MPC_MOVES_HEAT 2

/* The search. */
typedef struct {
    mpc_costate_term term[MPC_STAGES + 1]; /* after the last, one that ends the walk */
    mpc_costate_stretch
        stretch[MPC_STAGES + 2]; /* before the terms one that is none, after them one that ends */
    int32_t met;                 /* the last stretch whose limit is met */
    mpc_real value[2];           /* of the duals, and the part that no stage has */
    mpc_real constant_g[2];
    mpc_real share; /* of the way to the aim that is tried next */
    int32_t streak; /* rounds in a row that rose */
    int32_t moved;  /* by the next round, see above */
    int32_t here;   /* which dual the search is at */
    mpc_real certificate_g;
} mpc_search;

#endif
