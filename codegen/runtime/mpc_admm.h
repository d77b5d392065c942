/* The last two lines of an ADMM iteration for one row:
 *
 *     r <- a At + (1 - a) z,  z <- clip(r + y / rho, low, high),  y <- y + rho (r - z)
 */
#ifndef MPC_ADMM_H
#define MPC_ADMM_H

#include "mpc_model.h"
#include "mpc_real.h"

/* (1 - a) old + a new, a the over-relaxation */
static inline real_t relaxed(real_t new_value, real_t old_value)
{
    return (mpc_par.relaxation * new_value) + ((REAL(1.0) - mpc_par.relaxation) * old_value);
}

static inline void update_y(real_t r, real_t z_new, real_t rho, real_t *z, real_t *y)
{
    *y += rho * (r - z_new);
    *z = z_new;
}

static inline void update_equality(real_t product, real_t value, real_t *z, real_t *y)
{
    update_y(relaxed(product, *z), value, mpc_par.rho_equality, z, y);
}

static inline void update_above(real_t product, real_t low, real_t *z, real_t *y)
{
    const real_t r = relaxed(product, *z);
    update_y(r, real_max(r + (mpc_par.inverse_rho * *y), low), mpc_par.rho, z, y);
}

static inline void update_below(real_t product, real_t high, real_t *z, real_t *y)
{
    const real_t r = relaxed(product, *z);
    update_y(r, real_min(r + (mpc_par.inverse_rho * *y), high), mpc_par.rho, z, y);
}

static inline void update_between(real_t product, real_t low, real_t high, real_t *z, real_t *y)
{
    const real_t r = relaxed(product, *z);
    update_y(r, real_clip(r + (mpc_par.inverse_rho * *y), low, high), mpc_par.rho, z, y);
}

#endif
