/* The plant as a part. With a trip, demand and speed are that trip's, and outputs; without,
 * they are inputs. */
#include <math.h>
#include <stdio.h>

#include "mpc_instance.h"
#include "mpc_trip.h"

/* Demand and speed of a second that is coming; 0 after the trip. */
static void show_road(mpc_instance_state *state, int32_t second)
{
#if MPC_TRIP_S > 0
    if (second < MPC_TRIP_S) {
        state->value[MPC_VALUE_DEMAND_W] = trip_demand_w[second];
        state->value[MPC_VALUE_SPEED_MPS] = trip_speed_mps[second];
    } else {
        state->value[MPC_VALUE_DEMAND_W] = 0.0;
        state->value[MPC_VALUE_SPEED_MPS] = 0.0;
    }
#else
    (void)state;
    (void)second;
#endif
}

void mpc_part_first(mpc_instance_state *state)
{
    state->part.soc = state->value[MPC_VALUE_SOC_INIT];
    state->part.t_cl_degc = state->value[MPC_VALUE_T_CL_INIT_DEGC];
    state->value[MPC_VALUE_SOC] = state->part.soc;
    state->value[MPC_VALUE_T_CL_DEGC] = state->part.t_cl_degc;
    show_road(state, 0);
}

int32_t mpc_part_start(mpc_instance_state *state, char *message)
{
    (void)state;
    (void)message;
    return MPC_OK;
}

void mpc_part_decide(mpc_instance_state *state) { (void)state; /* the step does it all */ }

int32_t mpc_part_step(mpc_instance_state *state, char *message)
{
    const mpc_plant_asked asked = {state->value[MPC_VALUE_DEMAND_W],
                                   state->value[MPC_VALUE_SPEED_MPS],
                                   state->value[MPC_VALUE_P_ENG_COMMAND_W],
                                   (state->value[MPC_VALUE_ENGINE_ON_COMMAND] > 0.0) ? 1 : 0};
    int32_t status = MPC_ERROR;
    if (!(isfinite(asked.demand_w) && isfinite(asked.speed_mps) && isfinite(asked.p_command_w))) {
        (void)snprintf(message, MPC_MESSAGE, "%s", "an input is not a finite number");
    } else {
        mpc_plant_flows flows;
        mpc_plant_step(&state->part, &asked, &flows);
        state->value[MPC_VALUE_SOC] = state->part.soc;
        state->value[MPC_VALUE_T_CL_DEGC] = state->part.t_cl_degc;
        state->value[MPC_VALUE_ENGINE_ON] = (double)state->part.engine_on;
        state->value[MPC_VALUE_FUEL_G] = flows.fuel_g;
        state->value[MPC_VALUE_FUEL_TOTAL_G] += flows.fuel_g;
        state->value[MPC_VALUE_P_ENG_W] = flows.p_eng_w;
        state->value[MPC_VALUE_P_BAT_W] = flows.p_bat_w;
        state->value[MPC_VALUE_P_FRICTION_W] = flows.p_friction_w;
        state->value[MPC_VALUE_P_MISSING_W] = flows.p_missing_w;
        state->value[MPC_VALUE_POWER_EXCESS_W] = flows.power_excess_w;
        show_road(state, state->seconds + 1);
        status = MPC_OK;
    }
    return status;
}
