/* Trips for the fuzzer: what a car can drive, mostly. */
#ifndef ROAD_H
#define ROAD_H

#include <stddef.h>

#include "mpc_forecast.h"

/* Bytes of a fuzzer, read one by one; zeros when they are used up. */
typedef struct {
    const uint8_t *at;
    size_t left;
} source;

uint32_t bits(source *from);                           /* 32 of them */
uint32_t below(source *from, uint32_t count);          /* 0 to count - 1 */
double between(source *from, double low, double high); /* 16 bits fine */
mpc_real hostile(source *from);                        /* NaN, infinite, tiny, huge, .. */
mpc_road new_road(source *from);                       /* overwrites the one before */

#endif
