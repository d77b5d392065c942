/* One instance of a part: variables, modes, steps of a second. */
#include <math.h>
#include <stdio.h>

#include "mpc_instance.h"

#define STEP_S 1.0
#define STEP_TOLERANCE_S 1e-9
#define TIME_TOLERANCE_S 1e-6 /* of a sum of seconds */

static const char *const mode_names[] = {"instantiated", "initialization", "step", "terminated"};

static int32_t refused(mpc_instance *instance, int32_t status, const char *format, double given,
                       double wanted)
{
    (void)snprintf(instance->message, sizeof instance->message, format, given, wanted);
    return status;
}

int32_t mpc_instance_refuse(mpc_instance *instance, const char *what)
{
    (void)snprintf(instance->message, sizeof instance->message, "%s", what);
    return MPC_ERROR;
}

/* Whether the instance is in a mode between two. */
static int32_t is_between(mpc_instance *instance, int32_t first, int32_t last, const char *call)
{
    const int32_t mode = instance->state.mode;
    const int32_t fine = ((mode >= first) && (mode <= last)) ? 1 : 0;
    if (fine == 0) {
        (void)snprintf(instance->message, sizeof instance->message, "%s is not allowed in %s mode",
                       call, mode_names[mode]);
    }
    return fine;
}

void mpc_instance_reset(mpc_instance *instance)
{
    static const mpc_instance empty = {0};
    *instance = empty;
    for (int32_t i = 0; i < MPC_VARIABLES; i++) {
        instance->state.value[i] = mpc_variables[i].start;
    }
    mpc_part_first(&instance->state);
}

int32_t mpc_instance_setup(mpc_instance *instance, double start_s)
{
    int32_t status = MPC_ERROR;
    if (is_between(instance, MPC_INSTANTIATED, MPC_INSTANTIATED, "the start time") != 0) {
        if (isfinite(start_s)) {
            instance->state.start_s = start_s;
            instance->state.value[MPC_VALUE_TIME] = start_s;
            status = MPC_OK;
        } else {
            status = mpc_instance_refuse(instance, "the start time is not finite");
        }
    }
    return status;
}

/* From one mode to another. */
static int32_t moved(mpc_instance *instance, int32_t from, int32_t to, const char *call)
{
    int32_t status = MPC_ERROR;
    if (is_between(instance, from, from, call) != 0) {
        instance->state.mode = to;
        status = MPC_OK;
    }
    return status;
}

int32_t mpc_instance_enter(mpc_instance *instance)
{
    return moved(instance, MPC_INSTANTIATED, MPC_INITIALISING, "initialization");
}

static int32_t is_in_range(mpc_instance *instance, const mpc_variable *of, double value)
{
    const int32_t fine = ((value >= of->low) && (value <= of->high)) ? 1 : 0;
    if (fine == 0) {
        (void)snprintf(instance->message, sizeof instance->message,
                       "%s is %.9g: it must be %.9g to %.9g", of->name, value, of->low, of->high);
    }
    return fine;
}

static int32_t has_parameters(mpc_instance *instance)
{
    int32_t fine = 1;
    for (int32_t i = 0; i < MPC_VARIABLES; i++) {
        const mpc_variable *const of = &mpc_variables[i];
        if ((of->role == MPC_PARAMETER)
            && (is_in_range(instance, of, instance->state.value[i]) == 0)) {
            fine = 0;
        }
    }
    return fine;
}

int32_t mpc_instance_exit(mpc_instance *instance)
{
    int32_t status = MPC_ERROR;
    if ((is_between(instance, MPC_INITIALISING, MPC_INITIALISING, "the end of it") != 0)
        && (has_parameters(instance) != 0)) {
        status = mpc_part_start(&instance->state, instance->message);
        if (status <= MPC_WARNING) {
            instance->state.mode = MPC_STEPPING;
            instance->state.outputs = MPC_ASKED;
        }
    }
    return status;
}

int32_t mpc_instance_terminate(mpc_instance *instance)
{
    return moved(instance, MPC_STEPPING, MPC_TERMINATED, "termination");
}

double mpc_instance_time_s(const mpc_instance *instance)
{
    return instance->state.start_s + (STEP_S * (double)instance->state.seconds);
}

int32_t mpc_instance_has_arrived(const mpc_instance *instance)
{
    return ((MPC_TRIP_S > 0) && (instance->state.seconds >= MPC_TRIP_S)) ? 1 : 0;
}

/* Let outputs follow from the inputs of this second. */
static void decide(mpc_instance_state *state)
{
    if (state->outputs != MPC_DECIDED) {
        mpc_part_decide(state);
        state->outputs = MPC_DECIDED;
    }
}

int32_t mpc_instance_step(mpc_instance *instance, double from_s, double step_s)
{
    const double now_s = mpc_instance_time_s(instance);
    int32_t status = MPC_ERROR;
    if (is_between(instance, MPC_STEPPING, MPC_STEPPING, "a step") == 0) {
        /* said there */
    } else if (!(fabs(step_s - STEP_S) <= STEP_TOLERANCE_S)) {
        status =
            refused(instance, MPC_ERROR, "step size %.9g s: it must be %.9g s", step_s, STEP_S);
    } else if (!(fabs(from_s - now_s) <= TIME_TOLERANCE_S)) {
        status = refused(instance, MPC_ERROR, "step at %.9g s: this instance is at %.9g s", from_s,
                         now_s);
    } else if (mpc_instance_has_arrived(instance) != 0) {
        status = refused(instance, MPC_DISCARD, "step at %.9g s: the trip has ended, at %.9g s",
                         from_s, now_s);
    } else {
        decide(&instance->state);
        status = mpc_part_step(&instance->state, instance->message);
        if (status <= MPC_WARNING) {
            instance->state.seconds++;
            instance->state.outputs = MPC_INSTANCE_HELD;
            instance->state.value[MPC_VALUE_TIME] = mpc_instance_time_s(instance);
        }
    }
    return status;
}

static int32_t is_known(mpc_instance *instance, uint32_t reference, int32_t kind)
{
    int32_t fine = 0;
    if (reference >= (uint32_t)MPC_VARIABLES) {
        (void)snprintf(instance->message, sizeof instance->message,
                       "value reference %lu: there is none", (unsigned long)reference);
    } else if (mpc_variables[reference].kind != kind) {
        (void)snprintf(instance->message, sizeof instance->message,
                       "value reference %lu: %s is of another type", (unsigned long)reference,
                       mpc_variables[reference].name);
    } else {
        fine = 1;
    }
    return fine;
}

int32_t mpc_instance_get(mpc_instance *instance, uint32_t reference, int32_t kind, double *value)
{
    int32_t status = MPC_ERROR;
    if (is_known(instance, reference, kind) != 0) {
        const int32_t is_output = (mpc_variables[reference].role == MPC_OUTPUT) ? 1 : 0;
        if ((is_output != 0) && (instance->state.mode == MPC_STEPPING)
            && (instance->state.outputs == MPC_ASKED)
            && (mpc_instance_has_arrived(instance) == 0)) {
            decide(&instance->state);
        }
        *value = instance->state.value[reference];
        status = MPC_OK;
    }
    return status;
}

int32_t mpc_instance_set(mpc_instance *instance, uint32_t reference, int32_t kind, double value)
{
    int32_t status = MPC_ERROR;
    if (is_known(instance, reference, kind) != 0) {
        const mpc_variable *const of = &mpc_variables[reference];
        const int32_t last = (of->role == MPC_PARAMETER) ? MPC_INITIALISING : MPC_STEPPING;
        if ((of->role == MPC_INDEPENDENT) || (of->role == MPC_OUTPUT)) {
            (void)snprintf(instance->message, sizeof instance->message,
                           "%s cannot be set: it is neither an input nor a parameter", of->name);
        } else if (is_between(instance, MPC_INSTANTIATED, last, of->name) == 0) {
            /* said there */
        } else if ((of->role == MPC_TUNABLE) && (is_in_range(instance, of, value) == 0)) {
            status = MPC_DISCARD;
        } else {
            instance->state.value[reference] = value;
            instance->state.outputs = MPC_ASKED;
            if (of->role == MPC_PARAMETER) {
                mpc_part_first(&instance->state);
            }
            status = MPC_OK;
        }
    }
    return status;
}
