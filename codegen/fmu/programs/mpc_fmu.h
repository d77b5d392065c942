/* One instance of this FMU, apart from the version of FMI: variables, modes, steps of a second.
 *
 * mpc_fmi2.c or mpc_fmi3.c, whichever is here, calls the functions mpc_fmu_..., which call those of
 * the part that this FMU holds, mpc_fmu_part_.... All memory is that of the instance: any number of
 * them may run in one process, in several threads too.
 */
#ifndef MPC_FMU_H
#define MPC_FMU_H

#include <stddef.h>
#include <stdint.h>

#include "mpc_fmu_part.h"
#include "mpc_fmu_variables.h"

#define MPC_FMU_MESSAGE 200 /* characters at most */

enum { MPC_FMU_REAL = 0, MPC_FMU_INTEGER = 1, MPC_FMU_BOOLEAN = 2 };
enum { MPC_FMU_INDEPENDENT = 0, MPC_FMU_PARAMETER = 1, MPC_FMU_INPUT = 2, MPC_FMU_OUTPUT = 3 };
enum {
    MPC_FMU_OK = 0,
    MPC_FMU_WARNING = 1,
    MPC_FMU_DISCARD = 2,
    MPC_FMU_ERROR = 3
}; /* as in FMI */
enum {
    MPC_FMU_INSTANTIATED = 0,
    MPC_FMU_INITIALISING = 1,
    MPC_FMU_STEPPING = 2,
    MPC_FMU_TERMINATED = 3
};

typedef struct {
    int32_t kind;
    int32_t role;
    double start;
    double low; /* limits, of parameters */
    double high;
    const char *name;
} mpc_fmu_variable;

extern const char *const mpc_fmu_categories[4]; /* of messages, by status */

extern const mpc_fmu_variable mpc_fmu_variables[MPC_FMU_VARIABLES]; /* by value reference */

/* Outputs of the last step; inputs that came after it; outputs that follow from these. */
enum { MPC_FMU_HELD = 0, MPC_FMU_ASKED = 1, MPC_FMU_DECIDED = 2 };

/* All that changes. A copy of it is the whole state of an instance. */
typedef struct {
    double value[MPC_FMU_VARIABLES]; /* integers and booleans too, which it holds exactly */
    double start_s;
    int32_t seconds; /* done */
    int32_t mode;
    int32_t outputs; /* what they are: MPC_FMU_HELD and so on */
    mpc_fmu_part part;
} mpc_fmu_state;

typedef struct {
    mpc_fmu_state state;
    char message[MPC_FMU_MESSAGE]; /* why the last call returned anything but MPC_FMU_OK */
} mpc_fmu;

/* Each returns a status; with any but MPC_FMU_OK there is a message, and from MPC_FMU_DISCARD on
 * nothing was done. */
void mpc_fmu_reset(mpc_fmu *fmu);
int32_t mpc_fmu_setup(mpc_fmu *fmu, double start_s);
int32_t mpc_fmu_enter(mpc_fmu *fmu);
int32_t mpc_fmu_exit(mpc_fmu *fmu);
int32_t mpc_fmu_terminate(mpc_fmu *fmu);
int32_t mpc_fmu_step(mpc_fmu *fmu, double from_s, double step_s);
int32_t mpc_fmu_get(mpc_fmu *fmu, uint32_t reference, int32_t kind, double *value);
int32_t mpc_fmu_set(mpc_fmu *fmu, uint32_t reference, int32_t kind, double value);
int32_t mpc_fmu_refuse(mpc_fmu *fmu, const char *what);
double mpc_fmu_time_s(const mpc_fmu *fmu);
/* A copy of the state, into the memory of an earlier copy if there is one; NULL without memory. */
mpc_fmu_state *mpc_fmu_kept(const mpc_fmu *fmu, mpc_fmu_state *earlier);
int32_t mpc_fmu_has_arrived(const mpc_fmu *fmu); /* whether the trip is over */

/* The part: its outputs at the start, from the parameters; leaving initialisation; the outputs that
 * follow at once from inputs, as often as these change within a second; the end of that second. */
void mpc_fmu_part_first(mpc_fmu_state *state);
int32_t mpc_fmu_part_start(mpc_fmu_state *state, char *message);
void mpc_fmu_part_decide(mpc_fmu_state *state);
int32_t mpc_fmu_part_step(mpc_fmu_state *state, char *message);

#endif
