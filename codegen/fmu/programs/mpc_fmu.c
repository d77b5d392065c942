/* One instance of this FMU: variables, modes, steps of a second. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "mpc_fmu.h"

#define STEP_S 1.0
#define STEP_TOLERANCE_S 1e-9
#define TIME_TOLERANCE_S 1e-6 /* of a sum of seconds */

const char *const mpc_fmu_categories[4] = {"", "logStatusWarning", "logStatusDiscard",
                                           "logStatusError"};

static const char *const mode_names[] = {"instantiated", "initialization", "step", "terminated"};

static int32_t refused(mpc_fmu *fmu, int32_t status, const char *format, double given,
                       double wanted)
{
    (void)snprintf(fmu->message, sizeof fmu->message, format, given, wanted);
    return status;
}

int32_t mpc_fmu_refuse(mpc_fmu *fmu, const char *what)
{
    (void)snprintf(fmu->message, sizeof fmu->message, "%s", what);
    return MPC_FMU_ERROR;
}

/* Whether the instance is in a mode between two. */
static int32_t is_between(mpc_fmu *fmu, int32_t first, int32_t last, const char *call)
{
    const int32_t mode = fmu->state.mode;
    const int32_t fine = ((mode >= first) && (mode <= last)) ? 1 : 0;
    if (fine == 0) {
        (void)snprintf(fmu->message, sizeof fmu->message, "%s is not allowed in %s mode", call,
                       mode_names[mode]);
    }
    return fine;
}

void mpc_fmu_reset(mpc_fmu *fmu)
{
    static const mpc_fmu empty = {0};
    *fmu = empty;
    for (int32_t i = 0; i < MPC_FMU_VARIABLES; i++) {
        fmu->state.value[i] = mpc_fmu_variables[i].start;
    }
    mpc_fmu_part_first(&fmu->state);
}

int32_t mpc_fmu_setup(mpc_fmu *fmu, double start_s)
{
    int32_t status = MPC_FMU_ERROR;
    if (is_between(fmu, MPC_FMU_INSTANTIATED, MPC_FMU_INSTANTIATED, "the start time") != 0) {
        if (isfinite(start_s)) {
            fmu->state.start_s = start_s;
            fmu->state.value[MPC_FMU_TIME] = start_s;
            status = MPC_FMU_OK;
        } else {
            status = mpc_fmu_refuse(fmu, "the start time is not finite");
        }
    }
    return status;
}

/* From one mode to another. */
static int32_t moved(mpc_fmu *fmu, int32_t from, int32_t to, const char *call)
{
    int32_t status = MPC_FMU_ERROR;
    if (is_between(fmu, from, from, call) != 0) {
        fmu->state.mode = to;
        status = MPC_FMU_OK;
    }
    return status;
}

int32_t mpc_fmu_enter(mpc_fmu *fmu)
{
    return moved(fmu, MPC_FMU_INSTANTIATED, MPC_FMU_INITIALISING, "initialization");
}

static int32_t has_parameters(mpc_fmu *fmu)
{
    int32_t fine = 1;
    for (int32_t i = 0; i < MPC_FMU_VARIABLES; i++) {
        const mpc_fmu_variable *const of = &mpc_fmu_variables[i];
        const double value = fmu->state.value[i];
        if ((of->role == MPC_FMU_PARAMETER) && !((value >= of->low) && (value <= of->high))) {
            (void)snprintf(fmu->message, sizeof fmu->message, "%s is %.9g: it must be %.9g to %.9g",
                           of->name, value, of->low, of->high);
            fine = 0;
        }
    }
    return fine;
}

int32_t mpc_fmu_exit(mpc_fmu *fmu)
{
    int32_t status = MPC_FMU_ERROR;
    if ((is_between(fmu, MPC_FMU_INITIALISING, MPC_FMU_INITIALISING, "the end of it") != 0)
        && (has_parameters(fmu) != 0)) {
        status = mpc_fmu_part_start(&fmu->state, fmu->message);
        if (status <= MPC_FMU_WARNING) {
            fmu->state.mode = MPC_FMU_STEPPING;
            fmu->state.outputs = MPC_FMU_ASKED;
        }
    }
    return status;
}

int32_t mpc_fmu_terminate(mpc_fmu *fmu)
{
    return moved(fmu, MPC_FMU_STEPPING, MPC_FMU_TERMINATED, "termination");
}

mpc_fmu_state *mpc_fmu_kept(const mpc_fmu *fmu, mpc_fmu_state *earlier)
{
    mpc_fmu_state *const kept =
        (earlier != NULL) ? earlier : (mpc_fmu_state *)calloc(1, sizeof(mpc_fmu_state));
    if (kept != NULL) {
        *kept = fmu->state;
    }
    return kept;
}

double mpc_fmu_time_s(const mpc_fmu *fmu)
{
    return fmu->state.start_s + (STEP_S * (double)fmu->state.seconds);
}

int32_t mpc_fmu_has_arrived(const mpc_fmu *fmu)
{
    return ((MPC_FMU_TRIP_S > 0) && (fmu->state.seconds >= MPC_FMU_TRIP_S)) ? 1 : 0;
}

/* Let outputs follow from the inputs of this second. */
static void decide(mpc_fmu_state *state)
{
    if (state->outputs != MPC_FMU_DECIDED) {
        mpc_fmu_part_decide(state);
        state->outputs = MPC_FMU_DECIDED;
    }
}

int32_t mpc_fmu_step(mpc_fmu *fmu, double from_s, double step_s)
{
    const double now_s = mpc_fmu_time_s(fmu);
    int32_t status = MPC_FMU_ERROR;
    if (is_between(fmu, MPC_FMU_STEPPING, MPC_FMU_STEPPING, "a step") == 0) {
        /* said there */
    } else if (!(fabs(step_s - STEP_S) <= STEP_TOLERANCE_S)) {
        status = refused(fmu, MPC_FMU_ERROR, "step size %.9g s: it must be %.9g s", step_s, STEP_S);
    } else if (!(fabs(from_s - now_s) <= TIME_TOLERANCE_S)) {
        status = refused(fmu, MPC_FMU_ERROR,
                         "communication point %.9g s: this instance is at %.9g s", from_s, now_s);
    } else if (mpc_fmu_has_arrived(fmu) != 0) {
        status = refused(fmu, MPC_FMU_DISCARD, "step at %.9g s: the trip has ended, at %.9g s",
                         from_s, now_s);
    } else {
        decide(&fmu->state);
        status = mpc_fmu_part_step(&fmu->state, fmu->message);
        if (status <= MPC_FMU_WARNING) {
            fmu->state.seconds++;
            fmu->state.outputs = MPC_FMU_HELD;
            fmu->state.value[MPC_FMU_TIME] = mpc_fmu_time_s(fmu);
        }
    }
    return status;
}

static int32_t is_known(mpc_fmu *fmu, uint32_t reference, int32_t kind)
{
    int32_t fine = 0;
    if (reference >= (uint32_t)MPC_FMU_VARIABLES) {
        (void)snprintf(fmu->message, sizeof fmu->message, "value reference %lu: there is none",
                       (unsigned long)reference);
    } else if (mpc_fmu_variables[reference].kind != kind) {
        (void)snprintf(fmu->message, sizeof fmu->message,
                       "value reference %lu: %s is of another type", (unsigned long)reference,
                       mpc_fmu_variables[reference].name);
    } else {
        fine = 1;
    }
    return fine;
}

int32_t mpc_fmu_get(mpc_fmu *fmu, uint32_t reference, int32_t kind, double *value)
{
    int32_t status = MPC_FMU_ERROR;
    if (is_known(fmu, reference, kind) != 0) {
        const int32_t is_output = (mpc_fmu_variables[reference].role == MPC_FMU_OUTPUT) ? 1 : 0;
        if ((is_output != 0) && (fmu->state.mode == MPC_FMU_STEPPING)
            && (fmu->state.outputs == MPC_FMU_ASKED) && (mpc_fmu_has_arrived(fmu) == 0)) {
            decide(&fmu->state);
        }
        *value = fmu->state.value[reference];
        status = MPC_FMU_OK;
    }
    return status;
}

int32_t mpc_fmu_set(mpc_fmu *fmu, uint32_t reference, int32_t kind, double value)
{
    int32_t status = MPC_FMU_ERROR;
    if (is_known(fmu, reference, kind) != 0) {
        const mpc_fmu_variable *const of = &mpc_fmu_variables[reference];
        const int32_t last = (of->role == MPC_FMU_INPUT) ? MPC_FMU_STEPPING : MPC_FMU_INITIALISING;
        if ((of->role != MPC_FMU_INPUT) && (of->role != MPC_FMU_PARAMETER)) {
            (void)snprintf(fmu->message, sizeof fmu->message,
                           "%s cannot be set: it is neither an input nor a parameter", of->name);
        } else if (is_between(fmu, MPC_FMU_INSTANTIATED, last, of->name) != 0) {
            fmu->state.value[reference] = value;
            fmu->state.outputs = MPC_FMU_ASKED;
            if (of->role == MPC_FMU_PARAMETER) {
                mpc_fmu_part_first(&fmu->state);
            }
            status = MPC_FMU_OK;
        } else {
            /* said there */
        }
    }
    return status;
}
