/* Functional Mock-up Interface 3.0: the declarations of the standard, https://fmi-standard.org, as far as
 * they are needed here. */
#ifndef MPC_FMI3_H
#define MPC_FMI3_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "mpc_fmi.h"

/* Names of functions get FMI3_FUNCTION_PREFIX, if the build has one: to link several FMUs into one
 * program. In a shared library they have none. */
#if defined(FMI3_FUNCTION_PREFIX) && !defined(FMI3_OVERRIDE_FUNCTION_PREFIX)
#define NAME(name) PASTE(FMI3_FUNCTION_PREFIX, name)
#else
#define NAME(name) name
#endif
#define STATUS EXPORT fmi3Status

typedef void *fmi3Instance;
typedef void *fmi3InstanceEnvironment;
typedef void *fmi3FMUState;
typedef uint32_t fmi3ValueReference;
typedef double fmi3Float64;
typedef int32_t fmi3Int32;
typedef bool fmi3Boolean;
typedef bool fmi3Clock;
typedef const char *fmi3String;
typedef uint8_t fmi3Byte;
typedef const fmi3Byte *fmi3Binary;
typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment environment, fmi3Status status,
                                       fmi3String category, fmi3String message);
typedef void (*fmi3IntermediateUpdateCallback)(fmi3InstanceEnvironment environment,
                                               fmi3Float64 time, fmi3Boolean set, fmi3Boolean get,
                                               fmi3Boolean done, fmi3Boolean early,
                                               fmi3Boolean *wanted, fmi3Float64 *at);
typedef void (*fmi3ClockUpdateCallback)(fmi3InstanceEnvironment environment);
typedef void (*fmi3LockPreemptionCallback)(void);
typedef enum {
    fmi3Independent,
    fmi3Constant,
    fmi3Fixed,
    fmi3Tunable,
    fmi3Discrete,
    fmi3Dependent
} fmi3DependencyKind;
typedef enum {
    fmi3IntervalNotYetKnown,
    fmi3IntervalUnchanged,
    fmi3IntervalChanged
} fmi3IntervalQualifier;

/* Logs why a call is refused; returns fmi3Error. */
fmi3Status mpc_fmi3_refuse(fmi3Instance c, const char *why);

#endif
