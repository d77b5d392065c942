/* Arithmetic in the chosen precision, with exponentials and powers. */
#ifndef MPC_REAL_H
#define MPC_REAL_H

#include "mpc_arithmetic.h"
#if MPC_COSTATE
#include "mpc_elementary.h"
#endif

#if MPC_COSTATE
/* always the same work, also where the coolant's thermostat opens */
#define REAL_EXP(x) mpc_fixed_exp(x)
#define REAL_EXPM1(x) mpc_fixed_expm1(x)
#define REAL_LOG1P(x) mpc_fixed_log1p(x)
#define REAL_POW(x, y) mpc_fixed_pow((x), (y))
#elif MPC_F32
#define REAL_EXP(x) expf(x)
#define REAL_EXPM1(x) expm1f(x)
#define REAL_LOG1P(x) log1pf(x)
#define REAL_POW(x, y) powf((x), (y))
#else
#define REAL_EXP(x) exp(x)
#define REAL_EXPM1(x) expm1(x)
#define REAL_LOG1P(x) log1p(x)
#define REAL_POW(x, y) pow((x), (y))
#endif

#endif
