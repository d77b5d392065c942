/* The plant: one explicit step of SOC and coolant temperature, as qpmpc.vehicle.plant in Python. */
#ifndef MPC_PLANT_H
#define MPC_PLANT_H

#include <stdint.h>

/* At the start of a second. */
typedef struct {
    double soc;        /* of the battery, 0..1 */
    double t_cl_degc;  /* of the coolant */
    double p_eng_w;    /* in the last second, 0 with the engine off */
    int32_t engine_on; /* whether the engine ran in the last second */
} mpc_plant_state;

/* What is asked of the coming second. */
typedef struct {
    double demand_w;    /* negative when braking */
    double speed_mps;   /* mean */
    double p_command_w; /* of the engine */
    int32_t on_command;
} mpc_plant_asked;

/* What became of a second; see StepFlows in Python. */
typedef struct {
    double fuel_g;
    double p_eng_w;
    double p_bat_w;
    double p_friction_w;
    double p_missing_w;
    double power_excess_w;
} mpc_plant_flows;

/* Advance one second. All numbers must be finite. */
void mpc_plant_step(mpc_plant_state *state, const mpc_plant_asked *asked, mpc_plant_flows *flows);

#endif
