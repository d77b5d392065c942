/* The part of this FMU: the plant. */
#ifndef MPC_FMU_PART_H
#define MPC_FMU_PART_H

#include "mpc_plant.h"

typedef mpc_plant_state mpc_fmu_part;

#endif
