/* Elementary functions of a fixed amount of work: those of the C library take other paths for other
 * arguments. To round-off; log(1 + x) to that of 1 + x.
 */
#include "mpc_elementary.h"

#include "mpc_real.h"

#if MPC_F32
#define LOWEST REAL(-80.0)
#define LARGEST REAL(1.0e30)
#define EXP_TERMS 8
#define LOG_TERMS 5
#else
#define LOWEST REAL(-87.0)
#define LARGEST REAL(1.0e38)
#define EXP_TERMS 14
#define LOG_TERMS 12
#endif
#define BITS 7 /* of a power of two */
#define LOG2E REAL(1.4426950408889634)
#define LN2_HIGH REAL(0.693145751953125) /* short, so that products with whole numbers are exact */
#define LN2_LOW REAL(1.4286068203094172e-6)
#define LN2 REAL(0.6931471805599453)
#define LN_ROOT2 REAL(0.34657359027997264)
#define ROOT2 REAL(1.4142135623730951)

/* 1, and 2^-1, 2^-2, 2^-4 and so on: read, not chosen, which is the same work */
static const mpc_real factor[BITS][2] = {{REAL(1.0), REAL(0.5)},
                                         {REAL(1.0), REAL(0.25)},
                                         {REAL(1.0), REAL(0.0625)},
                                         {REAL(1.0), REAL(0.00390625)},
                                         {REAL(1.0), REAL(1.52587890625e-5)},
                                         {REAL(1.0), REAL(2.3283064365386963e-10)},
                                         {REAL(1.0), REAL(5.421010862427522e-20)}};

/* 2^-n, n below 16, and 2^-16n */
static const mpc_real fine[16] = {
    REAL(1.0),          REAL(0.5),           REAL(0.25),           REAL(0.125),
    REAL(0.0625),       REAL(0.03125),       REAL(0.015625),       REAL(0.0078125),
    REAL(0.00390625),   REAL(0.001953125),   REAL(0.0009765625),   REAL(0.00048828125),
    REAL(0.000244140625), REAL(0.0001220703125), REAL(0.00006103515625), REAL(0.000030517578125)};
static const mpc_real coarse[8] = {REAL(1.0),
                                   REAL(1.52587890625e-5),
                                   REAL(2.3283064365386963e-10),
                                   REAL(3.552713678800501e-15),
                                   REAL(5.421010862427522e-20),
                                   REAL(8.271806125530277e-25),
                                   REAL(1.262177448353619e-29),
                                   REAL(1.925929944387236e-34)};

/* exp(x) = (1 + rest) scale */
typedef struct {
    mpc_real rest;
    mpc_real scale;
} exponential;

static exponential exponential_of(mpc_real x)
{
    const mpc_real clipped = real_clip(x, LOWEST, REAL(0.0));
    const mpc_real halvings = REAL(0.5) - (clipped * LOG2E);
    const int32_t count = (int32_t)halvings;
    const mpc_real whole = (mpc_real)count;
    const mpc_real r = (clipped + (whole * LN2_HIGH)) + (whole * LN2_LOW);
    exponential found = {REAL(0.0), fine[count % 16] * coarse[(count / 16) % 8]};
    for (int32_t i = EXP_TERMS; i > 0; i--) {
        found.rest = (r * (REAL(1.0) + found.rest)) / (mpc_real)i;
    }
    return found;
}

mpc_real mpc_fixed_exp(mpc_real x)
{
    const exponential of = exponential_of(x);
    return of.scale + (of.scale * of.rest);
}

mpc_real mpc_fixed_expm1(mpc_real x)
{
    const exponential of = exponential_of(x);
    return (of.scale - REAL(1.0)) + (of.scale * of.rest);
}

/* With 1 + x = 2^n m, m below 2, and t = (m - sqrt 2) / (m + sqrt 2):
 * n ln 2 + ln(sqrt 2) + 2 (t + t^3 / 3 + t^5 / 5 + ..) */
mpc_real mpc_fixed_log1p(mpc_real x)
{
    mpc_real m = REAL(1.0) + real_clip(x, REAL(0.0), LARGEST);
    int32_t n = 0;
    int32_t power = 64;
    for (int32_t j = BITS - 1; j >= 0; j--) {
        const int32_t fits = ((m * factor[j][1]) >= REAL(1.0)) ? 1 : 0;
        m *= factor[j][fits];
        n += power * fits;
        power /= 2;
    }
    const mpc_real t = (m - ROOT2) / (m + ROOT2);
    const mpc_real square = t * t;
    mpc_real sum = REAL(0.0);
    for (int32_t i = LOG_TERMS; i >= 0; i--) {
        const int32_t odd = (2 * i) + 1;
        sum = (sum * square) + (REAL(1.0) / (mpc_real)odd);
    }
    return (((mpc_real)n * LN2) + LN_ROOT2) + (REAL(2.0) * t * sum);
}

/* x^y for x and y of 0 or more, by the logarithm of x or 1 / x */
mpc_real mpc_fixed_pow(mpc_real x, mpc_real y)
{
    const mpc_real inverse = REAL(1.0) / real_max(x, REAL(1.0) / LARGEST);
    const mpc_real larger = real_max(x, inverse);
    const mpc_real below = mpc_fixed_exp(-y * mpc_fixed_log1p(larger - REAL(1.0)));
    return (x > REAL(1.0)) ? (REAL(1.0) / below) : below;
}
