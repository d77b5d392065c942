/* Functional Mock-up Interface 2.0 for co-simulation. */
#include <stdlib.h>
#include <string.h>

#include "mpc_fmi2.h"
#include "mpc_fmi_instance.h"
#include "mpc_fmi_token.h"

typedef struct {
    mpc_instance fmu;
    fmi2CallbackFunctions functions;
    char *name;
} instance;

/* Messages are formats of printf here, and ours hold no percent sign. Some importers do not expand
 * them. Warnings and errors are logged whether debug logging is on or off: there is no other kind. */
static fmi2Status told(instance *of, int32_t status)
{
    if ((status != MPC_OK) && (of->functions.logger != NULL)) {
        of->functions.logger(of->functions.componentEnvironment, of->name, (fmi2Status)status,
                             mpc_fmi_categories[status], of->fmu.message);
    }
    return (fmi2Status)status;
}

fmi2Status mpc_fmi2_refuse(fmi2Component c, const char *why)
{
    instance *const of = (instance *)c;
    return told(of, mpc_instance_refuse(&of->fmu, why));
}

EXPORT const char *NAME(fmi2GetTypesPlatform)(void) { return "default"; }

EXPORT const char *NAME(fmi2GetVersion)(void) { return "2.0"; }

STATUS NAME(fmi2SetDebugLogging)(fmi2Component c, fmi2Boolean on, size_t count,
                                 const fmi2String names[])
{
    (void)c;
    (void)on;
    (void)count;
    (void)names;
    return fmi2OK;
}

static fmi2Component not_made(const fmi2CallbackFunctions *functions, fmi2String name,
                              const char *why)
{
    if ((functions != NULL) && (functions->logger != NULL)) {
        functions->logger(functions->componentEnvironment, name, fmi2Error,
                          mpc_fmi_categories[fmi2Error], why);
    }
    return NULL;
}

EXPORT fmi2Component NAME(fmi2Instantiate)(fmi2String name, fmi2Type type, fmi2String guid,
                                           fmi2String resources,
                                           const fmi2CallbackFunctions *functions,
                                           fmi2Boolean visible, fmi2Boolean logging)
{
    (void)resources;
    (void)visible;
    (void)logging;
    const char *const text = (name != NULL) ? name : "";
    if (type != fmi2CoSimulation) {
        return not_made(functions, text, "this FMU is for co-simulation only");
    }
    if ((guid == NULL) || (strcmp(guid, MPC_FMI_TOKEN) != 0)) {
        return not_made(functions, text, "the GUID is not that of this FMU");
    }
    instance *const made = (instance *)calloc(1, sizeof(instance));
    char *const kept = (char *)calloc(strlen(text) + 1U, 1U);
    if ((made == NULL) || (kept == NULL)) {
        free(made);
        free(kept);
        return not_made(functions, text, "not enough memory");
    }
    (void)strcpy(kept, text);
    made->name = kept;
    if (functions != NULL) {
        made->functions = *functions;
    }
    mpc_instance_reset(&made->fmu);
    return made;
}

EXPORT void NAME(fmi2FreeInstance)(fmi2Component c)
{
    if (c != NULL) {
        free(((instance *)c)->name);
        free(c);
    }
}

STATUS NAME(fmi2SetupExperiment)(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance,
                                 fmi2Real start_s, fmi2Boolean has_stop, fmi2Real stop_s)
{
    instance *const of = (instance *)c;
    (void)has_tolerance;
    (void)tolerance;
    (void)has_stop;
    (void)stop_s;
    return told(of, mpc_instance_setup(&of->fmu, start_s));
}

STATUS NAME(fmi2EnterInitializationMode)(fmi2Component c)
{
    instance *const of = (instance *)c;
    return told(of, mpc_instance_enter(&of->fmu));
}

STATUS NAME(fmi2ExitInitializationMode)(fmi2Component c)
{
    instance *const of = (instance *)c;
    return told(of, mpc_instance_exit(&of->fmu));
}

STATUS NAME(fmi2Terminate)(fmi2Component c)
{
    instance *const of = (instance *)c;
    return told(of, mpc_instance_terminate(&of->fmu));
}

STATUS NAME(fmi2Reset)(fmi2Component c)
{
    mpc_instance_reset(&((instance *)c)->fmu);
    return fmi2OK;
}

/* The functions that get and set the values of one type. */
#define GET_AND_SET(NAME_GET, NAME_SET, TYPE, KIND)                                                \
    STATUS NAME(NAME_GET)(fmi2Component c, const fmi2ValueReference vr[], size_t count,            \
                          TYPE value[])                                                            \
    {                                                                                              \
        instance *const of = (instance *)c;                                                        \
        int32_t status = MPC_OK;                                                                   \
        for (size_t i = 0U; (i < count) && (status == MPC_OK); i++) {                              \
            double found = 0.0;                                                                    \
            status = mpc_instance_get(&of->fmu, vr[i], (KIND), &found);                            \
            value[i] = (TYPE)found;                                                                \
        }                                                                                          \
        return told(of, status);                                                                   \
    }                                                                                              \
    STATUS NAME(NAME_SET)(fmi2Component c, const fmi2ValueReference vr[], size_t count,            \
                          const TYPE value[])                                                      \
    {                                                                                              \
        instance *const of = (instance *)c;                                                        \
        int32_t status = MPC_OK;                                                                   \
        for (size_t i = 0U; (i < count) && (status == MPC_OK); i++) {                              \
            status = mpc_instance_set(&of->fmu, vr[i], (KIND), (double)value[i]);                  \
        }                                                                                          \
        return told(of, status);                                                                   \
    }

GET_AND_SET(fmi2GetReal, fmi2SetReal, fmi2Real, MPC_REAL)
GET_AND_SET(fmi2GetInteger, fmi2SetInteger, fmi2Integer, MPC_INTEGER)
GET_AND_SET(fmi2GetBoolean, fmi2SetBoolean, fmi2Boolean, MPC_BOOLEAN)

STATUS NAME(fmi2DoStep)(fmi2Component c, fmi2Real from_s, fmi2Real step_s, fmi2Boolean no_return)
{
    instance *const of = (instance *)c;
    (void)no_return;
    return told(of, mpc_instance_step(&of->fmu, from_s, step_s));
}

STATUS NAME(fmi2GetRealStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
    fmi2Status status = fmi2OK;
    if (kind == fmi2LastSuccessfulTime) {
        *value = mpc_instance_time_s(&((instance *)c)->fmu);
    } else {
        status = mpc_fmi2_refuse(c, "fmi2GetRealStatus knows the last successful time only");
    }
    return status;
}

/* Terminated: the trip is over, and no step can follow. */
STATUS NAME(fmi2GetBooleanStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value)
{
    fmi2Status status = fmi2OK;
    if (kind == fmi2Terminated) {
        *value = (fmi2Boolean)mpc_instance_has_arrived(&((instance *)c)->fmu);
    } else {
        status = mpc_fmi2_refuse(c, "fmi2GetBooleanStatus knows fmi2Terminated only");
    }
    return status;
}

STATUS NAME(fmi2GetFMUstate)(fmi2Component c, fmi2FMUstate *state)
{
    mpc_instance_state *const kept =
        mpc_fmi_kept(&((instance *)c)->fmu, (mpc_instance_state *)*state);
    fmi2Status status = fmi2OK;
    if (kept != NULL) {
        *state = kept;
    } else {
        status = mpc_fmi2_refuse(c, "not enough memory");
    }
    return status;
}

STATUS NAME(fmi2SetFMUstate)(fmi2Component c, fmi2FMUstate state)
{
    ((instance *)c)->fmu.state = *(const mpc_instance_state *)state;
    return fmi2OK;
}

STATUS NAME(fmi2FreeFMUstate)(fmi2Component c, fmi2FMUstate *state)
{
    (void)c;
    if (state != NULL) {
        free(*state);
        *state = NULL;
    }
    return fmi2OK;
}
