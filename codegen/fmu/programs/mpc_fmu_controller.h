/* The part of this FMU: a generated controller and the trip that it knows. */
#ifndef MPC_FMU_PART_H
#define MPC_FMU_PART_H

#include "mpc_forecast.h"

typedef struct {
    mpc_state controller; /* at the start of the second */
    mpc_state decided;    /* after its decision */
    mpc_forecast forecast;
} mpc_fmu_part;

#endif
