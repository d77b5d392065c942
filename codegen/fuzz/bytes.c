#include "bytes.h"

#include <math.h>

uint32_t below(source *from, uint32_t count)
{
    uint32_t value = 0;
    for (int i = 0; i < ((count > 256) ? 2 : 1); i++) {
        value *= 256;
        if (from->left > 0) {
            value += *from->at;
            from->at++;
            from->left--;
        }
    }
    return value % count;
}

uint32_t bits(source *from)
{
    const uint32_t high = below(from, 65536);
    return (high << 16) | below(from, 65536);
}

double between(source *from, double low, double high)
{
    return low + (high - low) * below(from, 65536) / 65535;
}

mpc_real hostile(source *from)
{
    const double values[] = {(double)NAN,
                             (double)INFINITY,
                             -(double)INFINITY,
                             1e38,
                             -1e38,
                             1e9,
                             1e6,
                             -1e6,
                             1e5,
                             -1e5,
                             -1,
                             1e-30,
                             1e-40,
                             0,
                             -0.0,
                             1,
                             0.4,
                             0.8,
                             90,
                             130,
                             -60,
                             1.00001};
    return (mpc_real)values[below(from, sizeof values / sizeof values[0])];
}

void make_bytes(uint8_t *bytes, size_t size, uint64_t *random)
{
    for (size_t i = 0; i < size; i++) {
        *random = *random * 6364136223846793005u + 1442695040888963407u;
        bytes[i] = (uint8_t)(*random >> 56);
    }
}
