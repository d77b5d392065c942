/* Arithmetic in the chosen precision, without branches. */
#ifndef MPC_ARITHMETIC_H
#define MPC_ARITHMETIC_H

#include <math.h>
#include <stdint.h>

#include "mpc_config.h"
#if MPC_COSTATE && defined(__SSE2__)
#include <emmintrin.h>
#endif

#define REAL(literal) ((mpc_real)(literal))

#if MPC_F32
#define REAL_SQRT(x) sqrtf(x)
#define REAL_ABS(x) fabsf(x)
#define REAL_FMIN(a, b) fminf((a), (b))
#define REAL_FMAX(a, b) fmaxf((a), (b))
#else
#define REAL_SQRT(x) sqrt(x)
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
#elif MPC_COSTATE && defined(__SSE2__) && !defined(MPC_IN_LANES)
/* the instructions of x86 for the same, which gcc makes of it in some places alone */
#if MPC_F32
static inline mpc_real real_min(mpc_real a, mpc_real b)
{
    return _mm_cvtss_f32(_mm_min_ss(_mm_set_ss(a), _mm_set_ss(b)));
}
static inline mpc_real real_max(mpc_real a, mpc_real b)
{
    return _mm_cvtss_f32(_mm_max_ss(_mm_set_ss(a), _mm_set_ss(b)));
}
#else
static inline mpc_real real_min(mpc_real a, mpc_real b)
{
    return _mm_cvtsd_f64(_mm_min_sd(_mm_set_sd(a), _mm_set_sd(b)));
}
static inline mpc_real real_max(mpc_real a, mpc_real b)
{
    return _mm_cvtsd_f64(_mm_max_sd(_mm_set_sd(a), _mm_set_sd(b)));
}
#endif
#else
static inline mpc_real real_min(mpc_real a, mpc_real b) { return (a < b) ? a : b; }
static inline mpc_real real_max(mpc_real a, mpc_real b) { return (a > b) ? a : b; }
#endif
/* A choice by arithmetic, of which no compiler makes a branch: c is 1 or 0, the values are finite. */
static inline mpc_real blend(mpc_real c, mpc_real yes, mpc_real no)
{
    return (c * yes) + ((REAL(1.0) - c) * no);
}
static inline mpc_real above(mpc_real a, mpc_real b) { return (a > b) ? REAL(1.0) : REAL(0.0); }
static inline mpc_real not_below(mpc_real a, mpc_real b)
{
    return (a >= b) ? REAL(1.0) : REAL(0.0);
}
/* False for NaN, whatever the bounds. */
static inline int32_t within(mpc_real x, mpc_real low, mpc_real high)
{
    return ((x >= low) && (x <= high)) ? 1 : 0;
}
static inline mpc_real real_clip(mpc_real x, mpc_real low, mpc_real high)
{
    return real_min(real_max(x, low), high);
}

/* A choice without a branch. */
static inline mpc_real pick(int32_t condition, mpc_real yes, mpc_real no)
{
    return (condition != 0) ? yes : no;
}

#endif
