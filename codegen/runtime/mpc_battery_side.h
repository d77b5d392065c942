/* Power of engine and battery for the car's demand. */
#ifndef MPC_BATTERY_SIDE_H
#define MPC_BATTERY_SIDE_H

#include "mpc_model.h"
#include "mpc_real.h"

/* Net power of engine and battery: braking beyond the charge limit goes to the brakes. */
static inline mpc_real battery_side_w(mpc_real demand_w)
{
    return real_clip(demand_w + mpc_par.aux_power_w, -mpc_par.battery_charge_max_w,
                     mpc_par.battery_discharge_max_w + mpc_par.engine_max_w);
}

#endif
