/* Arithmetic in the chosen precision. */
#ifndef MPC_REAL_H
#define MPC_REAL_H

#include <math.h>
#include <stdint.h>

#include "mpc_config.h"

#define REAL(literal) ((mpc_real)(literal))

#if MPC_F32
#define REAL_SQRT(x) sqrtf(x)
#define REAL_POW(x, y) powf((x), (y))
#define REAL_EXP(x) expf(x)
#define REAL_EXPM1(x) expm1f(x)
#define REAL_LOG1P(x) log1pf(x)
#define REAL_ABS(x) fabsf(x)
#define REAL_FMIN(a, b) fminf((a), (b))
#define REAL_FMAX(a, b) fmaxf((a), (b))
#else
#define REAL_SQRT(x) sqrt(x)
#define REAL_POW(x, y) pow((x), (y))
#define REAL_EXP(x) exp(x)
#define REAL_EXPM1(x) expm1(x)
#define REAL_LOG1P(x) log1p(x)
#define REAL_ABS(x) fabs(x)
#define REAL_FMIN(a, b) fmin((a), (b))
#define REAL_FMAX(a, b) fmax((a), (b))
#endif

/* Without branches, so that time does not depend on data. With a NaN first and a number second the
 * result is the number. MPC_NATIVE_MINMAX, from the build, means that the processor has fmin and
 * fmax as instructions (the Cortex-M7's FPv5 does); elsewhere they are slow library calls. */
#if defined(MPC_NATIVE_MINMAX)
static inline mpc_real real_min(mpc_real a, mpc_real b) { return REAL_FMIN(a, b); }
static inline mpc_real real_max(mpc_real a, mpc_real b) { return REAL_FMAX(a, b); }
#else
static inline mpc_real real_min(mpc_real a, mpc_real b) { return (a < b) ? a : b; }
static inline mpc_real real_max(mpc_real a, mpc_real b) { return (a > b) ? a : b; }
#endif
/* False for NaN, whatever the bounds. */
static inline int32_t within(mpc_real x, mpc_real low, mpc_real high)
{
    return ((x >= low) && (x <= high)) ? 1 : 0;
}
static inline mpc_real real_clip(mpc_real x, mpc_real low, mpc_real high)
{
    return real_min(real_max(x, low), high);
}

#endif
