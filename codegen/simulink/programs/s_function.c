
#include "simstruc.h"

#include "mpc_instance.h"

#define STEP_S 1.0

/* How many of the first `before` variables have a role: that one's port, or their number in all. */
static int_T count_of(int32_t role, int32_t before)
{
    int_T count = 0;
    for (int32_t i = 0; i < before; i++) {
        count += (mpc_variables[i].role == role) ? 1 : 0;
    }
    return count;
}

static int_T type_of(const mpc_variable *of)
{
    int_T type = PORT_REAL_TYPE;
    if (of->kind == MPC_BOOLEAN) {
        type = SS_BOOLEAN;
    } else if (of->kind == MPC_INTEGER) {
        type = SS_INT32;
    } else {
        /* a real */
    }
    return type;
}

static mpc_instance *instance_of(SimStruct *S) { return (mpc_instance *)ssGetDWork(S, 0); }

/* Report what the instance says of a call that it refused, or warned of. */
static void report(SimStruct *S, const mpc_instance *instance, int32_t status)
{
    if (status > MPC_WARNING) {
        ssSetErrorStatus(S, instance->message);
    }
#ifdef MATLAB_MEX_FILE
    if (status == MPC_WARNING) {
        ssWarning(S, instance->message);
    }
#endif
}

#ifdef MATLAB_MEX_FILE
#define MDL_CHECK_PARAMETERS
static void mdlCheckParameters(SimStruct *S)
{
    for (int32_t i = 0; i < MPC_VARIABLES; i++) {
        const mpc_variable *const of = &mpc_variables[i];
        if (of->role == MPC_PARAMETER) {
            const mxArray *const given = ssGetSFcnParam(S, count_of(MPC_PARAMETER, i));
            const int_T is_number = mxIsDouble(given) && !mxIsComplex(given)
                                    && (mxGetNumberOfElements(given) == 1);
            const double value = is_number ? mxGetScalar(given) : 0.0;
            if (!(is_number && (value >= of->low) && (value <= of->high))) {
                ssSetErrorStatus(S, PARAMETERS);
            }
        }
    }
}
#endif

static void mdlInitializeSizes(SimStruct *S)
{
    const int_T parameters = count_of(MPC_PARAMETER, MPC_VARIABLES);
    ssSetNumSFcnParams(S, parameters);
    if (ssGetSFcnParamsCount(S) != parameters) {
        ssSetErrorStatus(S, PARAMETERS);
        return;
    }
#ifdef MATLAB_MEX_FILE
    mdlCheckParameters(S);
    if (ssGetErrorStatus(S) != NULL) {
        return;
    }
#endif
    for (int_T i = 0; i < parameters; i++) {
        ssSetSFcnParamTunable(S, i, 0); /* they are of the departure */
    }
    ssSetNumContStates(S, 0);
    ssSetNumDiscStates(S, 0);
    if (!ssSetNumInputPorts(S, count_of(MPC_INPUT, MPC_VARIABLES))
        || !ssSetNumOutputPorts(S, count_of(MPC_OUTPUT, MPC_VARIABLES))) {
        return; /* Simulink has said why */
    }
    for (int32_t i = 0; i < MPC_VARIABLES; i++) {
        const mpc_variable *const of = &mpc_variables[i];
        const int_T port = count_of(of->role, i);
        if (of->role == MPC_INPUT) {
            ssSetInputPortWidth(S, port, 1);
            ssSetInputPortDataType(S, port, type_of(of));
            ssSetInputPortRequiredContiguous(S, port, 1);
            ssSetInputPortDirectFeedThrough(S, port, DIRECT_FEEDTHROUGH);
        } else if (of->role == MPC_OUTPUT) {
            ssSetOutputPortWidth(S, port, 1);
            ssSetOutputPortDataType(S, port, type_of(of));
        } else {
            /* no port */
        }
    }
    ssSetNumSampleTimes(S, 1);
    /* All that changes is in this vector of the block's own; of doubles, because these are aligned. */
    ssSetNumDWork(S, 1);
    ssSetDWorkWidth(S, 0, (int_T)((sizeof(mpc_instance) + sizeof(double) - 1U) / sizeof(double)));
    ssSetDWorkDataType(S, 0, SS_DOUBLE);
}

static void mdlInitializeSampleTimes(SimStruct *S)
{
    ssSetSampleTime(S, 0, STEP_S);
    ssSetOffsetTime(S, 0, 0.0);
}

/* At the start, and where a subsystem that is enabled again resets its states. */
#define MDL_INITIALIZE_CONDITIONS
static void mdlInitializeConditions(SimStruct *S) { mpc_instance_reset(instance_of(S)); }

static void take_inputs(SimStruct *S, mpc_instance *instance)
{
    for (int32_t i = 0; i < MPC_VARIABLES; i++) {
        const mpc_variable *const of = &mpc_variables[i];
        if (of->role == MPC_INPUT) {
            const void *const signal = ssGetInputPortSignal(S, count_of(MPC_INPUT, i));
            const double value = (of->kind == MPC_BOOLEAN) ? (double)*(const boolean_T *)signal
                                                           : (double)*(const PORT_REAL *)signal;
            report(S, instance, mpc_instance_set(instance, (uint32_t)i, of->kind, value));
        }
    }
}

static void give_outputs(SimStruct *S, mpc_instance *instance)
{
    for (int32_t i = 0; i < MPC_VARIABLES; i++) {
        const mpc_variable *const of = &mpc_variables[i];
        if (of->role == MPC_OUTPUT) {
            void *const signal = ssGetOutputPortSignal(S, count_of(MPC_OUTPUT, i));
            double value = 0.0;
            report(S, instance, mpc_instance_get(instance, (uint32_t)i, of->kind, &value));
            if (of->kind == MPC_BOOLEAN) {
                *(boolean_T *)signal = (boolean_T)value;
            } else if (of->kind == MPC_INTEGER) {
                *(int32_T *)signal = (int32_T)value;
            } else {
                *(PORT_REAL *)signal = (PORT_REAL)value;
            }
        }
    }
}

/* Depart: with the first inputs, which Simulink does not have before the first outputs. */
static int32_t depart(SimStruct *S, mpc_instance *instance)
{
    int32_t status = mpc_instance_setup(instance, ssGetTaskTime(S, 0));
    for (int32_t i = 0; (i < MPC_VARIABLES) && (status == MPC_OK); i++) {
        if (mpc_variables[i].role == MPC_PARAMETER) {
            const mxArray *const given = ssGetSFcnParam(S, count_of(MPC_PARAMETER, i));
            status = mpc_instance_set(instance, (uint32_t)i, MPC_REAL, mxGetScalar(given));
        }
    }
    if (status == MPC_OK) {
        status = mpc_instance_enter(instance);
    }
    if (status == MPC_OK) {
        status = mpc_instance_exit(instance);
    }
    return status;
}

/* May be called several times a second, with other inputs: the last count. */
static void mdlOutputs(SimStruct *S, int_T tid)
{
    mpc_instance *const instance = instance_of(S);
    int32_t status = MPC_OK;
    (void)tid;
    if (mpc_instance_has_arrived(instance) != 0) {
        ssSetStopRequested(S, 1);
    } else {
#if DIRECT_FEEDTHROUGH
        take_inputs(S, instance);
#endif
        if (instance->state.mode == MPC_INSTANTIATED) {
            status = depart(S, instance);
            report(S, instance, status);
        }
    }
    if (status <= MPC_WARNING) {
        give_outputs(S, instance);
    }
}

#define MDL_UPDATE
static void mdlUpdate(SimStruct *S, int_T tid)
{
    mpc_instance *const instance = instance_of(S);
    (void)tid;
    if (mpc_instance_has_arrived(instance) == 0) {
#if !DIRECT_FEEDTHROUGH
        take_inputs(S, instance);
#endif
        report(S, instance, mpc_instance_step(instance, ssGetTaskTime(S, 0), STEP_S));
    }
}

static void mdlTerminate(SimStruct *S) { (void)S; /* nothing was allocated */ }

#ifdef MATLAB_MEX_FILE
#include "simulink.c"
#else
#include "cg_sfun.h"
#endif
