/* The last two lines of an ADMM iteration for one row:
 *
 *     r <- a At + (1 - a) z,  z <- clip(r + y / rho, low, high),  y <- y + rho (r - z)
 */
#ifndef MPC_ADMM_H
#define MPC_ADMM_H

#include "mpc_model.h"
#include "mpc_real.h"

/* (1 - a) old + a new, a the over-relaxation */
static inline mpc_real relaxed(mpc_real new_value, mpc_real old_value)
{
    return (mpc_par.relaxation * new_value) + ((REAL(1.0) - mpc_par.relaxation) * old_value);
}

static inline void update_y(mpc_real r, mpc_real z_new, mpc_real rho, mpc_real *z, mpc_real *y)
{
    *y += rho * (r - z_new);
    *z = z_new;
}

static inline void update_equality(mpc_real product, mpc_real value, mpc_real *z, mpc_real *y)
{
    update_y(relaxed(product, *z), value, mpc_par.rho_equality, z, y);
}

static inline void update_above(mpc_real product, mpc_real low, mpc_real *z, mpc_real *y)
{
    const mpc_real r = relaxed(product, *z);
    update_y(r, real_max(r + (mpc_par.inverse_rho * *y), low), mpc_par.rho, z, y);
}

static inline void update_below(mpc_real product, mpc_real high, mpc_real *z, mpc_real *y)
{
    const mpc_real r = relaxed(product, *z);
    update_y(r, real_min(r + (mpc_par.inverse_rho * *y), high), mpc_par.rho, z, y);
}

static inline void update_between(mpc_real product, mpc_real low, mpc_real high, mpc_real *z,
                                  mpc_real *y)
{
    const mpc_real r = relaxed(product, *z);
    update_y(r, real_clip(r + (mpc_par.inverse_rho * *y), low, high), mpc_par.rho, z, y);
}

#endif
