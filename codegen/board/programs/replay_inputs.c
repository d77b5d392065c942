/* The recorded trip as a controller's inputs. The host that checks the log runs this file too. */
#include "replay.h"

/* Memory with no wait states, e.g. -DREPLAY_FAST_MEMORY='__attribute__((section(".dtcm")))'. */
#ifndef REPLAY_FAST_MEMORY
#define REPLAY_FAST_MEMORY
#endif

static REPLAY_FAST_MEMORY mpc_state state;
static mpc_forecast forecast;
static mpc_in in;

int32_t replay_begin(void)
{
    const mpc_road trip = {replay_demand_w, replay_speed_mps, REPLAY_TRIP_S};
    const int32_t result = mpc_forecast_start(&forecast, &trip);
    mpc_init(&state);
    return (result == 0) ? replay_fill(0) : -1;
}

int32_t replay_depart(void) { return mpc_depart(&state, &in); }

int32_t replay_fill(int32_t second)
{
    const int32_t result = mpc_in_from_forecast(&forecast, second, &in);
    in.soc = replay_soc[second];
    in.t_cl_degc = replay_t_cl_degc[second];
    in.demand_w = replay_demand_w[second];
    in.speed_mps = replay_speed_mps[second];
    in.engine_on = (int32_t)replay_engine_on[second];
#if MPC_LEARNING
    in.fuel_g = replay_fuel_g[second];
#endif
    return result;
}

int32_t replay_decide(mpc_out *out) { return mpc_step(&state, &in, out); }
