/* The running engine in a second or stage at given prices, on the battery's own curve:
 *
 *     w_F f(E) + w_E E + w_G l(P0 - E)
 *
 * On a piece of f of slope a the slope of l has to be r = (w_F a + w_E) / w_G, at the battery power
 * U^2 (1 - 1 / r^2) / (4 R). The same in Python: qpmpc/pwa/priced.py.
 */
#ifndef MPC_PRICED_H
#define MPC_PRICED_H

#include "mpc_constants.h"
#include "mpc_model.h"
#include "mpc_real.h"

#define NEVER_G REAL(1.0e30) /* more than any second costs */

/* Prices w_F, w_E, w_G; those of fuel and power in that of the battery's store too. */
typedef struct {
    mpc_real fuel;
    mpc_real power;
    mpc_real internal;
    mpc_real per; /* 1 / internal */
    mpc_real fuel_ratio;
    mpc_real power_ratio;
} stage_prices;

static inline stage_prices prices_at(mpc_real internal, mpc_real fuel, mpc_real power)
{
    const mpc_real per = REAL(1.0) / real_max(internal, LEAST_PRICE);
    const stage_prices price = {fuel, power, internal, per, fuel * per, power * per};
    return price;
}

/* r of a piece of this slope */
static inline mpc_real ratio_at(const stage_prices *price, mpc_real slope)
{
    return real_max((price->fuel_ratio * slope) + price->power_ratio, LEAST_RATIO);
}

/* U^2 / (4 R) of the battery */
static inline mpc_real quarter_w(int32_t discharges)
{
    return pick(discharges, mpc_par.quarter_discharge_w, mpc_par.quarter_charge_w);
}

/* Power of the engine at which the slope of l is r */
static inline mpc_real stationary_w(mpc_real net_w, mpc_real ratio)
{
    const mpc_real inverse = REAL(1.0) / ratio;
    return net_w - (quarter_w((ratio > REAL(1.0)) ? 1 : 0) * (REAL(1.0) - (inverse * inverse)));
}

/* 1 - 4 R P / U^2 */
static inline mpc_real under_root(mpc_real power_w)
{
    return (REAL(1.0) - (power_w * mpc_par.per_quarter_mean))
           - (REAL_ABS(power_w) * mpc_par.per_quarter_half);
}

/* l(P); beyond the most that the battery can give the current stays. */
static inline mpc_real internal_w(mpc_real power_w)
{
    const mpc_real root = REAL_SQRT(real_max(under_root(power_w), REAL(0.0)));
    const mpc_real most = quarter_w((power_w > REAL(0.0)) ? 1 : 0);
    return (REAL(2.0) * real_min(power_w, most)) / (REAL(1.0) + root);
}

#endif
