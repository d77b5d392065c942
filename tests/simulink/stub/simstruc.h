/* A stub of Simulink's header: as much of its public interface as a generated S-function uses, in our
 * own words. It checks what Simulink would (ports that exist, the order of calls, inputs read where
 * there is no direct feedthrough) and notes each violation as an error of the block. */
#ifndef STUB_SIMSTRUC_H
#define STUB_SIMSTRUC_H

#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

typedef double real_T;
typedef float real32_T;
typedef double time_T;
typedef int int_T;
typedef int32_t int32_T;
typedef unsigned char boolean_T;
typedef int DTypeId;

/* Numbers of Simulink's built-in types. */
enum { SS_DOUBLE = 0, SS_SINGLE = 1, SS_INT32 = 6, SS_BOOLEAN = 8 };

enum { MOST_PORTS = 16, MOST_DWORKS = 2 };

/* Where in its life a block is. */
enum { IN_SIZES = 0, IN_TIMES = 1, IN_CONDITIONS = 2, IN_OUTPUTS = 3, IN_UPDATE = 4, IN_END = 5 };

typedef struct {
    int is_double;
    int is_complex;
    size_t count;
    double first;
} mxArray;

typedef struct {
    int width;
    int type;
    int contiguous;
    int feedthrough;
    union {
        real_T real;
        real32_T single;
        int32_T integer;
        boolean_T boolean;
    } signal;
} stub_port;

typedef struct {
    int width;
    int type;
    void *memory;
} stub_dwork;

typedef struct {
    int phase;
    int expected_parameters;
    int parameter_count;
    const mxArray *parameters;
    int tunable[MOST_PORTS];
    int states;
    int port_count[2]; /* inputs, outputs */
    stub_port port[2][MOST_PORTS];
    int dwork_count;
    stub_dwork dwork[MOST_DWORKS];
    int sample_times;
    double sample_time_s;
    double offset_s;
    double time_s;
    int stop_requested;
    const char *error;
    const char *warning;
} SimStruct;

static inline void stub_require(SimStruct *S, int holds, const char *what)
{
    if (!holds && (S->error == NULL)) {
        S->error = what;
    }
}

static inline stub_port *stub_port_of(SimStruct *S, int side, int port)
{
    const int there = (port >= 0) && (port < S->port_count[side]);
    stub_require(S, there, "stub: there is no such port");
    return &S->port[side][there ? port : 0];
}

static inline stub_dwork *stub_dwork_of(SimStruct *S, int index)
{
    const int there = (index >= 0) && (index < S->dwork_count);
    stub_require(S, there, "stub: there is no such work vector");
    return &S->dwork[there ? index : 0];
}

static inline int stub_set_ports(SimStruct *S, int side, int count)
{
    stub_require(S, (S->phase == IN_SIZES) && (count <= MOST_PORTS), "stub: number of ports");
    S->port_count[side] = count;
    for (int i = 0; i < count; i++) {
        S->port[side][i].width = 0; /* to be set */
        S->port[side][i].type = SS_DOUBLE;
    }
    return S->error == NULL;
}

static inline const void *stub_input(SimStruct *S, int port)
{
    stub_port *const of = stub_port_of(S, 0, port);
    stub_require(S, of->contiguous, "stub: the input is not contiguous");
    stub_require(S, (S->phase == IN_UPDATE) || ((S->phase == IN_OUTPUTS) && of->feedthrough),
                 "stub: an input is read where it has no value yet");
    return &of->signal;
}

static inline void *stub_output(SimStruct *S, int port)
{
    stub_require(S, S->phase == IN_OUTPUTS, "stub: an output is written outside mdlOutputs");
    return &stub_port_of(S, 1, port)->signal;
}

static inline const mxArray *stub_parameter(SimStruct *S, int index)
{
    static const mxArray none = {0, 0, 0, 0.0};
    const int there = (index >= 0) && (index < S->parameter_count);
    stub_require(S, there, "stub: there is no such parameter");
    return there ? &S->parameters[index] : &none;
}

static inline double stub_time_s(SimStruct *S, int index)
{
    stub_require(S, (index == 0) && ((S->phase == IN_OUTPUTS) || (S->phase == IN_UPDATE)),
                 "stub: there is no time yet");
    return S->time_s;
}

#define ssSetNumSFcnParams(S, n) ((S)->expected_parameters = (n))
#define ssGetNumSFcnParams(S) ((S)->expected_parameters)
#define ssGetSFcnParamsCount(S) ((S)->parameter_count)
#define ssGetSFcnParam(S, i) stub_parameter((S), (i))
#define ssSetSFcnParamTunable(S, i, on) ((S)->tunable[i] = (on))
#define mxIsDouble(a) ((a)->is_double)
#define mxIsComplex(a) ((a)->is_complex)
#define mxGetNumberOfElements(a) ((a)->count)
#define mxGetScalar(a) ((a)->first)

#define ssSetNumContStates(S, n) ((S)->states += (n))
#define ssSetNumDiscStates(S, n) ((S)->states += (n))
#define ssSetNumInputPorts(S, n) stub_set_ports((S), 0, (n))
#define ssSetNumOutputPorts(S, n) stub_set_ports((S), 1, (n))
#define ssSetInputPortWidth(S, p, n) (stub_port_of((S), 0, (p))->width = (n))
#define ssSetOutputPortWidth(S, p, n) (stub_port_of((S), 1, (p))->width = (n))
#define ssSetInputPortDataType(S, p, t) (stub_port_of((S), 0, (p))->type = (t))
#define ssSetOutputPortDataType(S, p, t) (stub_port_of((S), 1, (p))->type = (t))
#define ssSetInputPortRequiredContiguous(S, p, on) (stub_port_of((S), 0, (p))->contiguous = (on))
#define ssSetInputPortDirectFeedThrough(S, p, on) (stub_port_of((S), 0, (p))->feedthrough = (on))
#define ssGetInputPortSignal(S, p) stub_input((S), (p))
#define ssGetOutputPortSignal(S, p) stub_output((S), (p))

#define ssSetNumDWork(S, n) ((S)->dwork_count = (n))
#define ssSetDWorkWidth(S, i, n) (stub_dwork_of((S), (i))->width = (n))
#define ssSetDWorkDataType(S, i, t) (stub_dwork_of((S), (i))->type = (t))
#define ssGetDWork(S, i) (stub_dwork_of((S), (i))->memory)

#define ssSetNumSampleTimes(S, n) ((S)->sample_times = (n))
#define ssSetSampleTime(S, i, s) ((S)->sample_time_s = (s))
#define ssSetOffsetTime(S, i, s) ((S)->offset_s = (s))
#define ssGetTaskTime(S, i) stub_time_s((S), (i))

#define ssSetErrorStatus(S, text) ((S)->error = (text))
#define ssGetErrorStatus(S) ((S)->error)
#define ssWarning(S, text) ((S)->warning = (text))
#define ssSetStopRequested(S, on) ((S)->stop_requested = (on))

#endif
