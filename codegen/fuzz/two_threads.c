/* Two controllers in two threads decide, bit by bit, what each decides alone: two_threads STEPS. */
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drive.h"

#define MOST_STEPS 2000

typedef struct {
    uint8_t bytes[64]; /* of the trip */
    long steps;
    drive trip;
    mpc_state state;
    mpc_in in;
    mpc_out out[MOST_STEPS];
} run;

static void *drive_on(void *argument)
{
    run *const own = argument;
    source from = {own->bytes, sizeof own->bytes};
    mpc_init(&own->state);
    place_car(&own->trip, &from);
    take_road(&own->trip, &from);
    measure(&own->trip, &own->in);
    while (mpc_depart(&own->state, &own->in) > 0) {
    }
    for (long k = 0; k < own->steps; k++) {
        if (has_arrived(&own->trip)) {
            take_road(&own->trip, &from);
        }
        measure(&own->trip, &own->in);
        (void)mpc_step(&own->state, &own->in, &own->out[k]);
        move(&own->trip, &own->out[k], 1);
    }
    return NULL;
}

int main(int argc, char **argv)
{
    static run alone[2];
    static run together[2];
    pthread_t threads[2];
    uint64_t random = 1;
    const long steps = (argc == 2) ? strtol(argv[1], NULL, 10) : 0;
    if (steps < 1 || steps > MOST_STEPS) {
        return 2;
    }
    for (int i = 0; i < 2; i++) {
        make_bytes(together[i].bytes, sizeof together[i].bytes, &random);
        together[i].steps = steps;
        alone[i] = together[i];
        (void)drive_on(&alone[i]);
    }
    for (int i = 0; i < 2; i++) {
        if (pthread_create(&threads[i], NULL, drive_on, &together[i]) != 0) {
            return 3;
        }
    }
    int equal = memcmp(&alone[0].state, &alone[1].state, sizeof alone[0].state) != 0;
    for (int i = 0; i < 2; i++) {
        (void)pthread_join(threads[i], NULL);
        equal &= memcmp(alone[i].out, together[i].out, sizeof alone[i].out) == 0;
        equal &= memcmp(&alone[i].state, &together[i].state, sizeof alone[i].state) == 0;
    }
    printf("%s\n", equal ? "equal" : "different");
    return equal ? 0 : 1;
}
