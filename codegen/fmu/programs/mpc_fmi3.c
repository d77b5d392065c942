/* Functional Mock-up Interface 3.0 for co-simulation. */
#include <stdlib.h>
#include <string.h>

#include "mpc_fmi3.h"
#include "mpc_fmi_instance.h"
#include "mpc_fmi_token.h"

typedef struct {
    mpc_instance fmu;
    fmi3LogMessageCallback log;
    fmi3InstanceEnvironment environment;
} instance;

/* Warnings and errors are logged whether debug logging is on or off: there is no other kind. */
static fmi3Status told(instance *of, int32_t status)
{
    if ((status != MPC_OK) && (of->log != NULL)) {
        of->log(of->environment, (fmi3Status)status, mpc_fmi_categories[status], of->fmu.message);
    }
    return (fmi3Status)status;
}

fmi3Status mpc_fmi3_refuse(fmi3Instance c, const char *why)
{
    instance *const of = (instance *)c;
    return told(of, mpc_instance_refuse(&of->fmu, why));
}

EXPORT const char *NAME(fmi3GetVersion)(void) { return "3.0"; }

STATUS NAME(fmi3SetDebugLogging)(fmi3Instance c, fmi3Boolean on, size_t count,
                                 const fmi3String names[])
{
    (void)c;
    (void)on;
    (void)count;
    (void)names;
    return fmi3OK;
}

static fmi3Instance not_made(fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                             const char *why)
{
    if (log != NULL) {
        log(environment, fmi3Error, mpc_fmi_categories[fmi3Error], why);
    }
    return NULL;
}

EXPORT fmi3Instance NAME(fmi3InstantiateCoSimulation)(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean uses_events, fmi3Boolean allows_early_return,
    const fmi3ValueReference intermediate[], size_t intermediate_count,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
    fmi3IntermediateUpdateCallback update)
{
    (void)name;
    (void)resources;
    (void)visible;
    (void)logging;
    (void)allows_early_return;
    (void)intermediate;
    (void)update;
    if ((token == NULL) || (strcmp(token, MPC_FMI_TOKEN) != 0)) {
        return not_made(environment, log, "the instantiation token is not that of this FMU");
    }
    if (uses_events || (intermediate_count > 0U)) {
        return not_made(environment, log, "there are neither events nor intermediate variables");
    }
    instance *const made = (instance *)calloc(1, sizeof(instance));
    if (made == NULL) {
        return not_made(environment, log, "not enough memory");
    }
    made->log = log;
    made->environment = environment;
    mpc_instance_reset(&made->fmu);
    return made;
}

EXPORT void NAME(fmi3FreeInstance)(fmi3Instance c) { free(c); }

STATUS NAME(fmi3EnterInitializationMode)(fmi3Instance c, fmi3Boolean has_tolerance,
                                         fmi3Float64 tolerance, fmi3Float64 start_s,
                                         fmi3Boolean has_stop, fmi3Float64 stop_s)
{
    instance *const of = (instance *)c;
    (void)has_tolerance;
    (void)tolerance;
    (void)has_stop;
    (void)stop_s;
    int32_t status = mpc_instance_setup(&of->fmu, start_s);
    if (status == MPC_OK) {
        status = mpc_instance_enter(&of->fmu);
    }
    return told(of, status);
}

STATUS NAME(fmi3ExitInitializationMode)(fmi3Instance c)
{
    instance *const of = (instance *)c;
    return told(of, mpc_instance_exit(&of->fmu));
}

STATUS NAME(fmi3Terminate)(fmi3Instance c)
{
    instance *const of = (instance *)c;
    return told(of, mpc_instance_terminate(&of->fmu));
}

STATUS NAME(fmi3Reset)(fmi3Instance c)
{
    mpc_instance_reset(&((instance *)c)->fmu);
    return fmi3OK;
}

/* The functions that get and set the values of one type. */
#define GET_AND_SET(NAME_GET, NAME_SET, TYPE, KIND)                                                \
    STATUS NAME(NAME_GET)(fmi3Instance c, const fmi3ValueReference vr[], size_t count,             \
                          TYPE value[], size_t values)                                             \
    {                                                                                              \
        instance *const of = (instance *)c;                                                        \
        if (values != count) {                                                                     \
            return mpc_fmi3_refuse(c, "all variables are scalar: as many values as references");   \
        }                                                                                          \
        int32_t status = MPC_OK;                                                                   \
        for (size_t i = 0U; (i < count) && (status == MPC_OK); i++) {                              \
            double found = 0.0;                                                                    \
            status = mpc_instance_get(&of->fmu, vr[i], (KIND), &found);                            \
            value[i] = (TYPE)found;                                                                \
        }                                                                                          \
        return told(of, status);                                                                   \
    }                                                                                              \
    STATUS NAME(NAME_SET)(fmi3Instance c, const fmi3ValueReference vr[], size_t count,             \
                          const TYPE value[], size_t values)                                       \
    {                                                                                              \
        instance *const of = (instance *)c;                                                        \
        if (values != count) {                                                                     \
            return mpc_fmi3_refuse(c, "all variables are scalar: as many values as references");   \
        }                                                                                          \
        int32_t status = MPC_OK;                                                                   \
        for (size_t i = 0U; (i < count) && (status == MPC_OK); i++) {                              \
            status = mpc_instance_set(&of->fmu, vr[i], (KIND), (double)value[i]);                  \
        }                                                                                          \
        return told(of, status);                                                                   \
    }

GET_AND_SET(fmi3GetFloat64, fmi3SetFloat64, fmi3Float64, MPC_REAL)
GET_AND_SET(fmi3GetInt32, fmi3SetInt32, fmi3Int32, MPC_INTEGER)
GET_AND_SET(fmi3GetBoolean, fmi3SetBoolean, fmi3Boolean, MPC_BOOLEAN)

/* At arrival the end of the simulation is asked for; a step beyond it is discarded. */
STATUS NAME(fmi3DoStep)(fmi3Instance c, fmi3Float64 from_s, fmi3Float64 step_s,
                        fmi3Boolean no_return, fmi3Boolean *has_events, fmi3Boolean *terminate,
                        fmi3Boolean *is_early, fmi3Float64 *last_s)
{
    instance *const of = (instance *)c;
    (void)no_return;
    const int32_t status = mpc_instance_step(&of->fmu, from_s, step_s);
    *has_events = false;
    *terminate = (mpc_instance_has_arrived(&of->fmu) != 0);
    *is_early = false;
    *last_s = mpc_instance_time_s(&of->fmu);
    return told(of, status);
}

STATUS NAME(fmi3GetFMUState)(fmi3Instance c, fmi3FMUState *state)
{
    mpc_instance_state *const kept =
        mpc_fmi_kept(&((instance *)c)->fmu, (mpc_instance_state *)*state);
    fmi3Status status = fmi3OK;
    if (kept != NULL) {
        *state = kept;
    } else {
        status = mpc_fmi3_refuse(c, "not enough memory");
    }
    return status;
}

STATUS NAME(fmi3SetFMUState)(fmi3Instance c, fmi3FMUState state)
{
    ((instance *)c)->fmu.state = *(const mpc_instance_state *)state;
    return fmi3OK;
}

STATUS NAME(fmi3FreeFMUState)(fmi3Instance c, fmi3FMUState *state)
{
    (void)c;
    if (state != NULL) {
        free(*state);
        *state = NULL;
    }
    return fmi3OK;
}
