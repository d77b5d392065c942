/* Elementary functions of a fixed amount of work: those of the C library take other paths for other
 * arguments. To round-off; log(1 + x) to that of 1 + x.
 */
#include "mpc_real.h"

#if MPC_F32
#define LARGEST REAL(1.0e30)
#define LOG_TERMS 6
#else
#define LARGEST REAL(1.0e38)
#define LOG_TERMS 14
#endif
#define BITS 7 /* of a power of two */
#define LN2 REAL(0.6931471805599453)
#define LN_ROOT2 REAL(0.34657359027997264)
#define ROOT2 REAL(1.4142135623730951)

/* 2^-n, n below 16, and 2^-16n */
const mpc_real mpc_fixed_fine[16] = {REAL(1.0),
                                     REAL(0.5),
                                     REAL(0.25),
                                     REAL(0.125),
                                     REAL(0.0625),
                                     REAL(0.03125),
                                     REAL(0.015625),
                                     REAL(0.0078125),
                                     REAL(0.00390625),
                                     REAL(0.001953125),
                                     REAL(0.0009765625),
                                     REAL(0.00048828125),
                                     REAL(0.000244140625),
                                     REAL(0.0001220703125),
                                     REAL(0.00006103515625),
                                     REAL(0.000030517578125)};
const mpc_real mpc_fixed_coarse[8] = {REAL(1.0),
                                      REAL(1.52587890625e-5),
                                      REAL(2.3283064365386963e-10),
                                      REAL(3.552713678800501e-15),
                                      REAL(5.421010862427522e-20),
                                      REAL(8.271806125530277e-25),
                                      REAL(1.262177448353619e-29),
                                      REAL(1.925929944387236e-34)};

/* 1 / 1!, 1 / 2! and so on; 1 / (2 i + 1) */
#if MPC_F32
const mpc_real mpc_fixed_per_factorial[MPC_EXP_TERMS] = {REAL(1.0),
                                                         REAL(0.5),
                                                         REAL(0.16666666666666666),
                                                         REAL(0.041666666666666664),
                                                         REAL(0.008333333333333333),
                                                         REAL(0.001388888888888889),
                                                         REAL(0.0001984126984126984),
                                                         REAL(2.48015873015873e-05)};
static const mpc_real per_odd[LOG_TERMS] = {REAL(1.0),
                                            REAL(0.3333333333333333),
                                            REAL(0.2),
                                            REAL(0.14285714285714285),
                                            REAL(0.1111111111111111),
                                            REAL(0.09090909090909091)};
#else
const mpc_real mpc_fixed_per_factorial[MPC_EXP_TERMS] = {REAL(1.0),
                                                         REAL(0.5),
                                                         REAL(0.16666666666666666),
                                                         REAL(0.041666666666666664),
                                                         REAL(0.008333333333333333),
                                                         REAL(0.001388888888888889),
                                                         REAL(0.0001984126984126984),
                                                         REAL(2.48015873015873e-05),
                                                         REAL(2.7557319223985893e-06),
                                                         REAL(2.755731922398589e-07),
                                                         REAL(2.505210838544172e-08),
                                                         REAL(2.08767569878681e-09),
                                                         REAL(1.6059043836821613e-10),
                                                         REAL(1.1470745597729725e-11)};
static const mpc_real per_odd[LOG_TERMS] = {REAL(1.0),
                                            REAL(0.3333333333333333),
                                            REAL(0.2),
                                            REAL(0.14285714285714285),
                                            REAL(0.1111111111111111),
                                            REAL(0.09090909090909091),
                                            REAL(0.07692307692307693),
                                            REAL(0.06666666666666667),
                                            REAL(0.058823529411764705),
                                            REAL(0.05263157894736842),
                                            REAL(0.047619047619047616),
                                            REAL(0.043478260869565216),
                                            REAL(0.04),
                                            REAL(0.037037037037037035)};
#endif

/* With 1 + x = 2^n m, m below 2, and t = (m - sqrt 2) / (m + sqrt 2):
 * n ln 2 + ln(sqrt 2) + 2 (t + t^3 / 3 + t^5 / 5 + ..) */
mpc_real mpc_fixed_log1p(mpc_real x)
{
    /* 2^1, 2^2, 2^4 and so on, and their inverses */
    static const mpc_real doubled[BITS] = {REAL(2.0),
                                           REAL(4.0),
                                           REAL(16.0),
                                           REAL(256.0),
                                           REAL(65536.0),
                                           REAL(4294967296.0),
                                           REAL(18446744073709551616.0)};
    static const mpc_real factor[BITS] = {REAL(0.5),
                                          REAL(0.25),
                                          REAL(0.0625),
                                          REAL(0.00390625),
                                          REAL(1.52587890625e-5),
                                          REAL(2.3283064365386963e-10),
                                          REAL(5.421010862427522e-20)};
    mpc_real m = REAL(1.0) + real_clip(x, REAL(0.0), LARGEST);
    mpc_real n = REAL(0.0);
    mpc_real power = REAL(64.0);
    for (int32_t j = BITS - 1; j >= 0; j--) {
        const int32_t fits = (m >= doubled[j]) ? 1 : 0;
        n += pick(fits, power, REAL(0.0));
        m *= pick(fits, factor[j], REAL(1.0));
        power *= REAL(0.5);
    }
    const mpc_real t = (m - ROOT2) / (m + ROOT2);
    const mpc_real square = t * t;
    const mpc_real fourth = square * square;
    mpc_real even = REAL(0.0); /* two sums, as of the exponential */
    mpc_real odd = REAL(0.0);
    for (int32_t i = LOG_TERMS - 2; i >= 0; i -= 2) {
        even = (even * fourth) + per_odd[i];
        odd = (odd * fourth) + per_odd[i + 1];
    }
    return ((n * LN2) + LN_ROOT2) + (REAL(2.0) * t * (even + (square * odd)));
}

/* x^y for x of 0 or more and y above 0, by the logarithm of x or 1 / x */
mpc_real mpc_fixed_pow(mpc_real x, mpc_real y)
{
    const mpc_real inverse = REAL(1.0) / real_max(x, REAL(1.0) / LARGEST);
    const mpc_real larger = real_max(x, inverse);
    const mpc_real below = mpc_fixed_exp(-y * mpc_fixed_log1p(larger - REAL(1.0)));
    const mpc_real power = pick((x > REAL(1.0)) ? 1 : 0, REAL(1.0) / below, below);
    return above(x, REAL(0.0)) * power;
}
