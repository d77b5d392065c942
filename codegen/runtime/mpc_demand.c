/* Power demand from the road load. */
#include "mpc_constants.h"
#include "mpc_forecast.h"
#include "mpc_model.h"
#include "mpc_real.h"

/* Road load in the cold over that of its coefficients. */
static mpc_real cold_factor(void)
{
    const mpc_real below_k = real_max(ROAD_LOAD_DEGC - mpc_par.t_amb_degc, REAL(0.0));
    return REAL(1.0) + (mpc_par.road_load_share_per_k * below_k);
}

/* Share of the braking that is regenerative; the friction brakes take the rest. */
static mpc_real regen_share(mpc_real speed_mps)
{
    const mpc_real from_mps = mpc_par.regen_from_mps;
    const mpc_real full_mps = mpc_par.regen_full_mps;
    mpc_real share = REAL(1.0);
    if (full_mps > REAL(0.0)) {
        share = (speed_mps - from_mps) / (full_mps - from_mps);
    }
    return real_clip(share, REAL(0.0), REAL(1.0));
}

mpc_real mpc_demand_w(mpc_real speed_mps, mpc_real accel_mps2, mpc_real grade)
{
    const mpc_real rolling_n = (speed_mps > REAL(0.0)) ? mpc_par.road_load_a_n : REAL(0.0);
    const mpc_real drag_n = (mpc_par.road_load_b_n_per_mps * speed_mps)
                            + (mpc_par.road_load_c_n_per_mps2 * speed_mps * speed_mps);
    const mpc_real inertia_n = mpc_par.mass_kg * mpc_par.rotating_mass_factor * accel_mps2;
    const mpc_real slope_n = mpc_par.mass_kg * GRAVITY_MPS2 * grade
                             / REAL_SQRT(REAL(1.0) + (grade * grade));
    const mpc_real wheel_w = ((cold_factor() * (rolling_n + drag_n)) + inertia_n + slope_n)
                             * speed_mps;
    const mpc_real braking_w = wheel_w * mpc_par.eta_regen * regen_share(speed_mps);
    return (wheel_w >= REAL(0.0)) ? (wheel_w / mpc_par.eta_drive) : braking_w;
}
