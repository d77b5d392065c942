/* Functional Mock-up Interface 2.0: the functions for what this FMU does not offer. They exist, as the
 * standard asks, and return fmi2Error with a message. */
#include "mpc_fmi2.h"

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter" /* nearly all of them */
#endif

STATUS NAME(fmi2GetString)(fmi2Component c, const fmi2ValueReference vr[], size_t count,
                           fmi2String value[])
{
    return (count == 0U) ? fmi2OK : mpc_fmi2_refuse(c, "this FMU has no strings");
}

STATUS NAME(fmi2SetString)(fmi2Component c, const fmi2ValueReference vr[], size_t count,
                           const fmi2String value[])
{
    return (count == 0U) ? fmi2OK : mpc_fmi2_refuse(c, "this FMU has no strings");
}

STATUS NAME(fmi2CancelStep)(fmi2Component c)
{
    return mpc_fmi2_refuse(c, "no step is ever pending");
}

STATUS NAME(fmi2GetStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value)
{
    return mpc_fmi2_refuse(c, "no step is ever pending");
}

STATUS NAME(fmi2GetIntegerStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value)
{
    return mpc_fmi2_refuse(c, "there is no status that is an integer");
}

STATUS NAME(fmi2GetStringStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2String *value)
{
    return mpc_fmi2_refuse(c, "no step is ever pending");
}

STATUS NAME(fmi2SerializedFMUstateSize)(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    return mpc_fmi2_refuse(c, "states cannot be serialized");
}

STATUS NAME(fmi2SerializeFMUstate)(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[],
                                   size_t size)
{
    return mpc_fmi2_refuse(c, "states cannot be serialized");
}

STATUS NAME(fmi2DeSerializeFMUstate)(fmi2Component c, const fmi2Byte bytes[], size_t size,
                                     fmi2FMUstate *state)
{
    return mpc_fmi2_refuse(c, "states cannot be serialized");
}

STATUS NAME(fmi2GetDirectionalDerivative)(fmi2Component c, const fmi2ValueReference unknown[],
                                          size_t unknowns, const fmi2ValueReference known[],
                                          size_t knowns, const fmi2Real seed[],
                                          fmi2Real sensitivity[])
{
    return mpc_fmi2_refuse(c, "there are no derivatives");
}

STATUS NAME(fmi2SetRealInputDerivatives)(fmi2Component c, const fmi2ValueReference vr[],
                                         size_t count, const fmi2Integer order[],
                                         const fmi2Real value[])
{
    return mpc_fmi2_refuse(c, "inputs are not interpolated");
}

STATUS NAME(fmi2GetRealOutputDerivatives)(fmi2Component c, const fmi2ValueReference vr[],
                                          size_t count, const fmi2Integer order[], fmi2Real value[])
{
    return mpc_fmi2_refuse(c, "there are no derivatives");
}
