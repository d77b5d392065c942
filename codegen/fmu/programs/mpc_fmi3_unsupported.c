/* Functional Mock-up Interface 3.0: the functions for what this FMU does not offer. They exist, as the
 * standard asks, and return fmi3Error with a message. */
#include "mpc_fmi3.h"

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter" /* nearly all of them */
#endif

/* Of a type that no variable has: nothing to get or set is fine. */
#define NO_TYPE(NAME_GET, NAME_SET, TYPE)                                                          \
    STATUS NAME(NAME_GET)(fmi3Instance c, const fmi3ValueReference vr[], size_t count,             \
                          TYPE value[], size_t values)                                             \
    {                                                                                              \
        return (count == 0U) ? fmi3OK : mpc_fmi3_refuse(c, "no variable is of this type");         \
    }                                                                                              \
    STATUS NAME(NAME_SET)(fmi3Instance c, const fmi3ValueReference vr[], size_t count,             \
                          const TYPE value[], size_t values)                                       \
    {                                                                                              \
        return (count == 0U) ? fmi3OK : mpc_fmi3_refuse(c, "no variable is of this type");         \
    }

NO_TYPE(fmi3GetFloat32, fmi3SetFloat32, float)
NO_TYPE(fmi3GetInt8, fmi3SetInt8, int8_t)
NO_TYPE(fmi3GetUInt8, fmi3SetUInt8, uint8_t)
NO_TYPE(fmi3GetInt16, fmi3SetInt16, int16_t)
NO_TYPE(fmi3GetUInt16, fmi3SetUInt16, uint16_t)
NO_TYPE(fmi3GetUInt32, fmi3SetUInt32, uint32_t)
NO_TYPE(fmi3GetInt64, fmi3SetInt64, int64_t)
NO_TYPE(fmi3GetUInt64, fmi3SetUInt64, uint64_t)
NO_TYPE(fmi3GetString, fmi3SetString, fmi3String)

/* Of modes that there are not. */
#define NO_MODE(NAME_OF, WHY)                                                                      \
    STATUS NAME(NAME_OF)(fmi3Instance c) { return mpc_fmi3_refuse(c, (WHY)); }

NO_MODE(fmi3EnterEventMode, "there are no events")
NO_MODE(fmi3EnterConfigurationMode, "there are no structural parameters")
NO_MODE(fmi3ExitConfigurationMode, "there are no structural parameters")
NO_MODE(fmi3EvaluateDiscreteStates, "there are no events")
NO_MODE(fmi3EnterContinuousTimeMode, "this FMU is for co-simulation only")
NO_MODE(fmi3EnterStepMode, "there are no events")

STATUS NAME(fmi3GetBinary)(fmi3Instance c, const fmi3ValueReference vr[], size_t count,
                           size_t sizes[], fmi3Binary values[], size_t n)
{
    return mpc_fmi3_refuse(c, "no variable is of this type");
}

STATUS NAME(fmi3GetClock)(fmi3Instance c, const fmi3ValueReference vr[], size_t count,
                          fmi3Clock values[])
{
    return mpc_fmi3_refuse(c, "there are no clocks");
}

STATUS NAME(fmi3SetBinary)(fmi3Instance c, const fmi3ValueReference vr[], size_t count,
                           const size_t sizes[], const fmi3Binary values[], size_t n)
{
    return mpc_fmi3_refuse(c, "no variable is of this type");
}

STATUS NAME(fmi3SetClock)(fmi3Instance c, const fmi3ValueReference vr[], size_t count,
                          const fmi3Clock values[])
{
    return mpc_fmi3_refuse(c, "there are no clocks");
}

STATUS NAME(fmi3GetNumberOfVariableDependencies)(fmi3Instance c, fmi3ValueReference vr, size_t *n)
{
    return mpc_fmi3_refuse(c, "dependencies are in modelDescription.xml");
}

STATUS NAME(fmi3GetVariableDependencies)(fmi3Instance c, fmi3ValueReference vr, size_t elements[],
                                         fmi3ValueReference known[], size_t others[],
                                         fmi3DependencyKind kinds[], size_t n)
{
    return mpc_fmi3_refuse(c, "dependencies are in modelDescription.xml");
}

STATUS NAME(fmi3SerializedFMUStateSize)(fmi3Instance c, fmi3FMUState state, size_t *size)
{
    return mpc_fmi3_refuse(c, "states cannot be serialized");
}

STATUS NAME(fmi3SerializeFMUState)(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[],
                                   size_t size)
{
    return mpc_fmi3_refuse(c, "states cannot be serialized");
}

STATUS NAME(fmi3DeserializeFMUState)(fmi3Instance c, const fmi3Byte bytes[], size_t size,
                                     fmi3FMUState *state)
{
    return mpc_fmi3_refuse(c, "states cannot be serialized");
}

STATUS NAME(fmi3GetDirectionalDerivative)(fmi3Instance c, const fmi3ValueReference unknown[],
                                          size_t unknown_count, const fmi3ValueReference known[],
                                          size_t known_count, const fmi3Float64 seed[],
                                          size_t seeds, fmi3Float64 sensitivity[], size_t n)
{
    return mpc_fmi3_refuse(c, "there are no derivatives");
}

STATUS NAME(fmi3GetAdjointDerivative)(fmi3Instance c, const fmi3ValueReference unknown[],
                                      size_t unknown_count, const fmi3ValueReference known[],
                                      size_t known_count, const fmi3Float64 seed[], size_t seeds,
                                      fmi3Float64 sensitivity[], size_t n)
{
    return mpc_fmi3_refuse(c, "there are no derivatives");
}

STATUS NAME(fmi3GetIntervalDecimal)(fmi3Instance c, const fmi3ValueReference vr[], size_t count,
                                    fmi3Float64 intervals[], fmi3IntervalQualifier known[])
{
    return mpc_fmi3_refuse(c, "there are no clocks");
}

STATUS NAME(fmi3GetIntervalFraction)(fmi3Instance c, const fmi3ValueReference vr[], size_t count,
                                     uint64_t counter[], uint64_t resolution[],
                                     fmi3IntervalQualifier known[])
{
    return mpc_fmi3_refuse(c, "there are no clocks");
}

STATUS NAME(fmi3GetShiftDecimal)(fmi3Instance c, const fmi3ValueReference vr[], size_t count,
                                 fmi3Float64 shifts[])
{
    return mpc_fmi3_refuse(c, "there are no clocks");
}

STATUS NAME(fmi3GetShiftFraction)(fmi3Instance c, const fmi3ValueReference vr[], size_t count,
                                  uint64_t counter[], uint64_t resolution[])
{
    return mpc_fmi3_refuse(c, "there are no clocks");
}

STATUS NAME(fmi3SetIntervalDecimal)(fmi3Instance c, const fmi3ValueReference vr[], size_t count,
                                    const fmi3Float64 intervals[])
{
    return mpc_fmi3_refuse(c, "there are no clocks");
}

STATUS NAME(fmi3SetIntervalFraction)(fmi3Instance c, const fmi3ValueReference vr[], size_t count,
                                     const uint64_t counter[], const uint64_t resolution[])
{
    return mpc_fmi3_refuse(c, "there are no clocks");
}

STATUS NAME(fmi3SetShiftDecimal)(fmi3Instance c, const fmi3ValueReference vr[], size_t count,
                                 const fmi3Float64 shifts[])
{
    return mpc_fmi3_refuse(c, "there are no clocks");
}

STATUS NAME(fmi3SetShiftFraction)(fmi3Instance c, const fmi3ValueReference vr[], size_t count,
                                  const uint64_t counter[], const uint64_t resolution[])
{
    return mpc_fmi3_refuse(c, "there are no clocks");
}

STATUS NAME(fmi3UpdateDiscreteStates)(fmi3Instance c, fmi3Boolean *again, fmi3Boolean *terminate,
                                      fmi3Boolean *nominals, fmi3Boolean *changed,
                                      fmi3Boolean *has_next, fmi3Float64 *next_s)
{
    return mpc_fmi3_refuse(c, "there are no events");
}

STATUS NAME(fmi3CompletedIntegratorStep)(fmi3Instance c, fmi3Boolean no_return, fmi3Boolean *event,
                                         fmi3Boolean *terminate)
{
    return mpc_fmi3_refuse(c, "this FMU is for co-simulation only");
}

STATUS NAME(fmi3SetTime)(fmi3Instance c, fmi3Float64 time)
{
    return mpc_fmi3_refuse(c, "this FMU is for co-simulation only");
}

STATUS NAME(fmi3SetContinuousStates)(fmi3Instance c, const fmi3Float64 x[], size_t n)
{
    return mpc_fmi3_refuse(c, "this FMU is for co-simulation only");
}

STATUS NAME(fmi3GetContinuousStateDerivatives)(fmi3Instance c, fmi3Float64 dx[], size_t n)
{
    return mpc_fmi3_refuse(c, "there are no derivatives");
}

STATUS NAME(fmi3GetEventIndicators)(fmi3Instance c, fmi3Float64 z[], size_t n)
{
    return mpc_fmi3_refuse(c, "this FMU is for co-simulation only");
}

STATUS NAME(fmi3GetContinuousStates)(fmi3Instance c, fmi3Float64 x[], size_t n)
{
    return mpc_fmi3_refuse(c, "this FMU is for co-simulation only");
}

STATUS NAME(fmi3GetNominalsOfContinuousStates)(fmi3Instance c, fmi3Float64 nominals[], size_t n)
{
    return mpc_fmi3_refuse(c, "this FMU is for co-simulation only");
}

STATUS NAME(fmi3GetNumberOfEventIndicators)(fmi3Instance c, size_t *n)
{
    return mpc_fmi3_refuse(c, "this FMU is for co-simulation only");
}

STATUS NAME(fmi3GetNumberOfContinuousStates)(fmi3Instance c, size_t *n)
{
    return mpc_fmi3_refuse(c, "this FMU is for co-simulation only");
}

STATUS NAME(fmi3GetOutputDerivatives)(fmi3Instance c, const fmi3ValueReference vr[], size_t count,
                                      const fmi3Int32 orders[], fmi3Float64 values[], size_t n)
{
    return mpc_fmi3_refuse(c, "there are no derivatives");
}

STATUS NAME(fmi3ActivateModelPartition)(fmi3Instance c, fmi3ValueReference clock, fmi3Float64 at_s)
{
    return mpc_fmi3_refuse(c, "there are no clocks");
}

EXPORT fmi3Instance NAME(fmi3InstantiateModelExchange)(fmi3String name, fmi3String token,
                                                       fmi3String resources, fmi3Boolean visible,
                                                       fmi3Boolean logging,
                                                       fmi3InstanceEnvironment environment,
                                                       fmi3LogMessageCallback log)
{
    if (log != NULL) {
        log(environment, fmi3Error, "logStatusError", "this FMU is for co-simulation only");
    }
    return NULL;
}

EXPORT fmi3Instance NAME(fmi3InstantiateScheduledExecution)(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
    fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
    fmi3LockPreemptionCallback unlock)
{
    if (log != NULL) {
        log(environment, fmi3Error, "logStatusError", "this FMU is for co-simulation only");
    }
    return NULL;
}
