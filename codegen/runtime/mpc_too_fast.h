/* Speed at which the engine may not be off. */
#ifndef MPC_TOO_FAST_H
#define MPC_TOO_FAST_H

#include "mpc_model.h"
#include "mpc_real.h"

/* Whether the engine must run, at any power, because of the speed of the car. */
static inline int32_t is_too_fast(mpc_real speed_mps)
{
    return (speed_mps > mpc_par.electric_max_mps) ? 1 : 0;
}

#endif
