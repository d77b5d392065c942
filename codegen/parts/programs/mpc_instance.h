/* One instance of a part, for whatever simulates it: variables, modes, steps of a second.
 *
 * The glue of a simulation tool (of FMI 2.0 or 3.0, of Simulink) calls the functions mpc_instance_...,
 * which call those of the part that is here, controller or plant, mpc_part_.... All memory is that of
 * the instance: any number of them may run in one process, in several threads too.
 */
#ifndef MPC_INSTANCE_H
#define MPC_INSTANCE_H

#include <stdint.h>

#include "mpc_part.h"
#include "mpc_variables.h"

#define MPC_MESSAGE 200 /* characters at most */

enum { MPC_REAL = 0, MPC_INTEGER = 1, MPC_BOOLEAN = 2 };
enum { MPC_INDEPENDENT = 0, MPC_PARAMETER = 1, MPC_INPUT = 2, MPC_OUTPUT = 3, MPC_TUNABLE = 4 };
enum { MPC_OK = 0, MPC_WARNING = 1, MPC_DISCARD = 2, MPC_ERROR = 3 }; /* as in FMI */
enum { MPC_INSTANTIATED = 0, MPC_INITIALISING = 1, MPC_STEPPING = 2, MPC_TERMINATED = 3 };

typedef struct {
    int32_t kind;
    int32_t role;
    double start;
    double low; /* limits, of parameters, tunable or not */
    double high;
    const char *name;
} mpc_variable;

extern const mpc_variable mpc_variables[MPC_VARIABLES]; /* by value reference */

/* Outputs of the last step; inputs that came after it; outputs that follow from these. */
enum { MPC_INSTANCE_HELD = 0, MPC_ASKED = 1, MPC_DECIDED = 2 };

/* All that changes. A copy of it is the whole state of an instance. */
typedef struct {
    double value[MPC_VARIABLES]; /* integers and booleans too, which it holds exactly */
    double start_s;
    int32_t seconds; /* done */
    int32_t mode;
    int32_t outputs; /* what they are: MPC_INSTANCE_HELD and so on */
    mpc_part part;
} mpc_instance_state;

typedef struct {
    mpc_instance_state state;
    char message[MPC_MESSAGE]; /* why the last call returned anything but MPC_OK */
} mpc_instance;

/* Each returns a status; with any but MPC_OK there is a message, and from MPC_DISCARD on
 * nothing was done. */
void mpc_instance_reset(mpc_instance *instance);
int32_t mpc_instance_setup(mpc_instance *instance, double start_s);
int32_t mpc_instance_enter(mpc_instance *instance);
int32_t mpc_instance_exit(mpc_instance *instance);
int32_t mpc_instance_terminate(mpc_instance *instance);
int32_t mpc_instance_step(mpc_instance *instance, double from_s, double step_s);
int32_t mpc_instance_get(mpc_instance *instance, uint32_t reference, int32_t kind, double *value);
int32_t mpc_instance_set(mpc_instance *instance, uint32_t reference, int32_t kind, double value);
int32_t mpc_instance_refuse(mpc_instance *instance, const char *what);
double mpc_instance_time_s(const mpc_instance *instance);
int32_t mpc_instance_has_arrived(const mpc_instance *instance); /* whether the trip is over */

/* The part: its outputs at the start, from the parameters; leaving initialisation; the outputs that
 * follow at once from inputs, as often as these change within a second; the end of that second. */
void mpc_part_first(mpc_instance_state *state);
int32_t mpc_part_start(mpc_instance_state *state, char *message);
void mpc_part_decide(mpc_instance_state *state);
int32_t mpc_part_step(mpc_instance_state *state, char *message);

#endif
