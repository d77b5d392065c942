/* The part that is here: the plant. */
#ifndef MPC_PART_H
#define MPC_PART_H

#include "mpc_plant.h"

typedef mpc_plant_state mpc_part;

#endif
