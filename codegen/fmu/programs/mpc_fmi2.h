/* Functional Mock-up Interface 2.0: the declarations of the standard, https://fmi-standard.org, as far as
 * they are needed here. */
#ifndef MPC_FMI2_H
#define MPC_FMI2_H

#include <stddef.h>

#include "mpc_fmi.h"

/* Names of functions get FMI2_FUNCTION_PREFIX, if the build has one: to link several FMUs into one
 * program. In a shared library they have none. */
#if defined(FMI2_FUNCTION_PREFIX) && !defined(FMI2_OVERRIDE_FUNCTION_PREFIX)
#define NAME(name) PASTE(FMI2_FUNCTION_PREFIX, name)
#else
#define NAME(name) name
#endif
#define STATUS EXPORT fmi2Status

typedef void *fmi2Component;
typedef void *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef const char *fmi2String;
typedef char fmi2Byte;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum {
    fmi2DoStepStatus,
    fmi2PendingStatus,
    fmi2LastSuccessfulTime,
    fmi2Terminated
} fmi2StatusKind;
typedef void (*fmi2CallbackLogger)(void *environment, fmi2String instance, fmi2Status status,
                                   fmi2String category, fmi2String message, ...);
typedef struct {
    fmi2CallbackLogger logger;
    void *(*allocateMemory)(size_t count, size_t size);
    void (*freeMemory)(void *memory);
    void (*stepFinished)(void *environment, fmi2Status status);
    void *componentEnvironment;
} fmi2CallbackFunctions;

/* Logs why a call is refused; returns fmi2Error. */
fmi2Status mpc_fmi2_refuse(fmi2Component c, const char *why);

#endif
