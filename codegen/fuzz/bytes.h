/* Bytes of a fuzzer, read one by one; zeros when they are used up. */
#ifndef BYTES_H
#define BYTES_H

#include <stddef.h>
#include <stdint.h>

#include "mpc_config.h"

typedef struct {
    const uint8_t *at;
    size_t left;
} source;

uint32_t bits(source *from);                           /* 32 of them */
uint32_t below(source *from, uint32_t count);          /* 0 to count - 1 */
double between(source *from, double low, double high); /* 16 bits fine */
mpc_real hostile(source *from);                        /* NaN, infinite, tiny, huge, at limits */
void make_bytes(uint8_t *bytes, size_t size, uint64_t *random);

#endif
