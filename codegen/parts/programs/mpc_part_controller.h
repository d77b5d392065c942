/* The part that is here: a generated controller and the trip that it knows. */
#ifndef MPC_PART_H
#define MPC_PART_H

#include "mpc_forecast.h"

typedef struct {
    mpc_state controller; /* at the start of the second */
    mpc_state decided;    /* after its decision */
    mpc_forecast forecast;
    int32_t wrong_entry; /* of the calibration that the decision refused, -1 if none */
} mpc_part;

#endif
