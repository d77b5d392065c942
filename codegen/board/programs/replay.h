/* A recorded trip, and the controller decided through it second by second, in open loop.
 *
 * Inputs are those of the recorded run, whatever the controller commands: the same on every board.
 */
#ifndef REPLAY_H
#define REPLAY_H

#include "mpc_forecast.h"
#include "replay_config.h"

/* replay_data.c: demand and speed of the whole trip, measurements of the recorded seconds. */
extern const mpc_real replay_demand_w[REPLAY_TRIP_S];
extern const mpc_real replay_speed_mps[REPLAY_TRIP_S];
extern const mpc_real replay_soc[REPLAY_SECONDS];
extern const mpc_real replay_t_cl_degc[REPLAY_SECONDS];
extern const uint8_t replay_engine_on[REPLAY_SECONDS];
#if MPC_LEARNING
extern const mpc_real replay_fuel_g[REPLAY_SECONDS];
#endif

/* Take the trip as forecast and set a defined state. Returns 0, or -1: the trip is refused. */
int32_t replay_begin(void);

/* One slice of the departure, if REPLAY_PREPARED; returns 1 while slices remain. */
int32_t replay_depart(void);

/* Fill in the inputs of a second from the forecast and the record; returns 0. */
int32_t replay_fill(int32_t second);

/* Decide it; returns its flags. */
int32_t replay_decide(mpc_out *out);

/* The whole trip, each second a line of the log. Returns 0, or -1: the trip is refused. */
int32_t replay_run(void);

#endif
