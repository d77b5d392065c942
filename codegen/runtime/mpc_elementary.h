/* Elementary functions of a fixed amount of work, whatever their argument. */
#ifndef MPC_ELEMENTARY_H
#define MPC_ELEMENTARY_H

#include "mpc_config.h"

/* exp(x) and exp(x) - 1 of x <= 0, and log(1 + x) of x >= 0. */
mpc_real mpc_fixed_exp(mpc_real x);
mpc_real mpc_fixed_expm1(mpc_real x);
mpc_real mpc_fixed_log1p(mpc_real x);
mpc_real mpc_fixed_pow(mpc_real x, mpc_real y);

#endif
