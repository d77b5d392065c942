/* Elementary functions of a fixed amount of work, whatever their argument. */
#ifndef MPC_ELEMENTARY_H
#define MPC_ELEMENTARY_H

#include "mpc_arithmetic.h"
#include "mpc_config.h"

#if MPC_F32
#define MPC_EXP_LOWEST REAL(-80.0)
#define MPC_EXP_TERMS 8
#else
#define MPC_EXP_LOWEST REAL(-87.0)
#define MPC_EXP_TERMS 14
#endif
#define MPC_LOG2E REAL(1.4426950408889634)
#define MPC_LN2_HIGH REAL(0.693145751953125) /* short: products with whole numbers are exact */
#define MPC_LN2_LOW REAL(1.4286068203094172e-6)

/* 2^-n, n below 16, and 2^-16n: read, not chosen, which is the same work */
extern const mpc_real mpc_fixed_fine[16];
extern const mpc_real mpc_fixed_coarse[8];

/* 1 / 1!, 1 / 2! and so on */
extern const mpc_real mpc_fixed_per_factorial[MPC_EXP_TERMS];

/* exp(x) = (1 + rest) scale */
typedef struct {
    mpc_real rest;
    mpc_real scale;
} mpc_exponential;

static inline mpc_exponential exponential_of(mpc_real x)
{
    const mpc_real clipped = real_clip(x, MPC_EXP_LOWEST, REAL(0.0));
    const mpc_real halvings = REAL(0.5) - (clipped * MPC_LOG2E);
    const int32_t times = (int32_t)halvings;
    const mpc_real whole = (mpc_real)times;
    const mpc_real r = (clipped + (whole * MPC_LN2_HIGH)) + (whole * MPC_LN2_LOW);
    const mpc_real square = r * r;
    mpc_real even = REAL(0.0); /* powers of r, by their factorials: two sums, which do not wait */
    mpc_real odd = REAL(0.0);
    for (int32_t i = MPC_EXP_TERMS - 2; i >= 0; i -= 2) {
        even = (even * square) + mpc_fixed_per_factorial[i];
        odd = (odd * square) + mpc_fixed_per_factorial[i + 1];
    }
    const mpc_exponential found = {r * (even + (r * odd)),
                                   mpc_fixed_fine[times % 16] * mpc_fixed_coarse[(times / 16) % 8]};
    return found;
}

/* exp(x) and exp(x) - 1 of x <= 0, here because both are asked of one x */
static inline mpc_real mpc_fixed_exp(mpc_real x)
{
    const mpc_exponential of = exponential_of(x);
    return of.scale + (of.scale * of.rest);
}

static inline mpc_real mpc_fixed_expm1(mpc_real x)
{
    const mpc_exponential of = exponential_of(x);
    return (of.scale - REAL(1.0)) + (of.scale * of.rest);
}

/* log(1 + x) of x >= 0, and x^y of x >= 0 and y > 0 */
mpc_real mpc_fixed_log1p(mpc_real x);
mpc_real mpc_fixed_pow(mpc_real x, mpc_real y);

#endif
