/* Seconds in which the engine must run, as in qpmpc/vehicle/must_run.py. */
#ifndef MPC_MUST_RUN_H
#define MPC_MUST_RUN_H

#include "mpc_model.h"
#include "mpc_real.h"

/* Whether the engine must run, at any power, because of the speed of the car. */
static inline int32_t is_too_fast(mpc_real speed_mps)
{
    return (speed_mps > mpc_par.electric_max_mps) ? 1 : 0;
}

/* Whether it must run because of its power or the speed. */
static inline int32_t must_run(mpc_real net_w, mpc_real speed_mps)
{
    return ((net_w > mpc_par.battery_discharge_max_w) ? 1 : 0) | is_too_fast(speed_mps);
}

/* For how many seconds a run of the engine that has begun has to go on. */
static inline int32_t begun_s(int32_t engine_on, int32_t engine_for_s)
{
    const int32_t left_s = mpc_par.min_on_s - engine_for_s;
    return ((engine_on != 0) && (left_s > 0)) ? left_s : 0;
}

#endif
