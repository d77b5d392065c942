/* A controller as a part: the preview of each second is that of the trip in mpc_trip.h, the measured
 * values are inputs. */
#include <stdio.h>

#include "mpc_instance.h"
#include "mpc_part_calibration.h"
#include "mpc_trip.h"

static const mpc_road trip = {trip_demand_w, trip_speed_mps, MPC_TRIP_S};

static void fill(mpc_instance_state *state, mpc_in *in)
{
    /* a saved state may come back where this code lies elsewhere */
    state->part.forecast.trip = trip;
    (void)mpc_in_from_forecast(&state->part.forecast, state->seconds, in);
    in->soc = (mpc_real)state->value[MPC_VALUE_SOC];
    in->t_cl_degc = (mpc_real)state->value[MPC_VALUE_T_CL_DEGC];
    in->demand_w = (mpc_real)state->value[MPC_VALUE_DEMAND_W];
    in->speed_mps = (mpc_real)state->value[MPC_VALUE_SPEED_MPS];
    in->engine_on = (state->value[MPC_VALUE_ENGINE_ON] > 0.0) ? 1 : 0;
#if MPC_LEARNING
    in->fuel_g = (mpc_real)state->value[MPC_VALUE_FUEL_G];
#endif
}

void mpc_part_first(mpc_instance_state *state)
{
    (void)state; /* its outputs start at their start */
}

int32_t mpc_part_start(mpc_instance_state *state, char *message)
{
    int32_t status = MPC_OK;
    mpc_init(&state->part.controller);
    calibrate(state->value, &state->part.controller.calibration);
    if (mpc_forecast_start(&state->part.forecast, &trip) != 0) {
        (void)snprintf(message, MPC_MESSAGE, "%s",
                       "the trip has a demand or a speed that this car cannot do");
        status = MPC_ERROR;
    }
#if MPC_PREPARED
    else {
        mpc_in in;
        int32_t left = 1;
        fill(state, &in);
        while (left > 0) {
            left = mpc_depart(&state->part.controller, &in);
        }
        if (left < 0) {
            (void)snprintf(
                message, MPC_MESSAGE, "%s",
                "no plan before the trip, because of an input out of range at the start: "
                "the rules drive first");
            status = MPC_WARNING;
        }
    }
#endif
    return status;
}

void mpc_part_decide(mpc_instance_state *state)
{
    mpc_in in;
    mpc_out out;
    fill(state, &in);
    state->part.decided = state->part.controller;
    calibrate(state->value, &state->part.decided.calibration);
    (void)mpc_step(&state->part.decided, &in, &out);
    state->value[MPC_VALUE_ENGINE_ON_COMMAND] = (double)out.engine_on;
    state->value[MPC_VALUE_P_ENG_COMMAND_W] = (double)out.p_eng_w;
    state->value[MPC_VALUE_ON_SHARE] = (double)out.on_share;
#if MPC_COSTATE
    state->value[MPC_VALUE_CERTIFICATE_G] = (double)out.certificate_g;
#else
    state->value[MPC_VALUE_RELAXATION_GAP] = (double)out.relaxation_gap;
#endif
    state->value[MPC_VALUE_RUNG] = (double)out.rung;
    state->value[MPC_VALUE_FLAGS] = (double)out.flags;
    state->part.wrong_entry = out.wrong_entry;
}

int32_t mpc_part_step(mpc_instance_state *state, char *message)
{
    const int32_t wrong = state->part.wrong_entry;
    int32_t status = MPC_OK;
    if (wrong >= 0) { /* each alone is within its bounds */
        (void)snprintf(
            message, MPC_MESSAGE,
            "the calibration is refused, the last good one is in use: %s is too high for "
            "another number",
            mpc_variables[MPC_VALUE_OF_CALIBRATION + wrong].name);
        status = MPC_WARNING;
    }
    state->part.controller = state->part.decided;
    return status;
}
