/* Power demand from the road load. */
#include "mpc_constants.h"
#include "mpc_forecast.h"
#include "mpc_model.h"
#include "mpc_real.h"

mpc_real mpc_demand_w(mpc_real speed_mps, mpc_real accel_mps2, mpc_real grade)
{
    const mpc_real rolling_n = (speed_mps > REAL(0.0)) ? mpc_par.road_load_a_n : REAL(0.0);
    const mpc_real drag_n = (mpc_par.road_load_b_n_per_mps * speed_mps)
                            + (mpc_par.road_load_c_n_per_mps2 * speed_mps * speed_mps);
    const mpc_real inertia_n = mpc_par.mass_kg * mpc_par.rotating_mass_factor * accel_mps2;
    const mpc_real slope_n = mpc_par.mass_kg * GRAVITY_MPS2 * grade
                             / REAL_SQRT(REAL(1.0) + (grade * grade));
    const mpc_real wheel_w = (rolling_n + drag_n + inertia_n + slope_n) * speed_mps;
    return (wheel_w >= REAL(0.0)) ? (wheel_w / mpc_par.eta_drive) : (wheel_w * mpc_par.eta_regen);
}
