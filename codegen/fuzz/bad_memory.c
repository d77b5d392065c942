/* Memory that is no controller's, or a controller's with a part overwritten: bad_memory STRIDE.
 *
 * Never initialised: mpc_depart refuses, mpc_step says MPC_BAD_STATE and its rules drive. Then, one
 * after the other, every byte of the counts, marks and calibrations and every STRIDE-th of the stages
 * of a good state is flipped, and every word there overwritten: every step keeps its promises, and all is
 * well again afterwards. Prints how many were tried and how many were found out.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drive.h"
#include "mpc_model.h"
#include "promises.h"

/* From the largest error of SOC or coolant that passes for true memory until it is found out. */
#define LONGEST_RECOVERY_S 150

static mpc_state state;
static mpc_state good;
static drive trip;
static drive at_good;
static mpc_in in;
static mpc_out out;
static long tried;
static long found_out;

static void step(void)
{
    measure(&trip, &in);
    memset(&out, 0xff, sizeof out);
    check_promises(&state, &in, &out, mpc_step(&state, &in, &out));
    restore(&state, &out);
    move(&trip, &out, 1);
}

/* At least three more seconds, until nothing is flagged. */
static void recover(const char *after)
{
    for (int k = 0; k < 3 || out.flags != 0; k++) {
        require(k < LONGEST_RECOVERY_S && !has_arrived(&trip), after, &state, &out);
        step();
    }
    require(out.rung == MPC_OPTIMISED, after, &state, &out);
}

static void expect_bad_state(const char *what)
{
    require(out.flags & MPC_BAD_STATE, what, &state, &out);
    require(out.rung == MPC_RULES, what, &state, &out);
}

static void never_initialised(uint64_t *random)
{
    static const int values[] = {0, 0xFF, 0x55, -1, -1, -1};
    for (int i = 0; i < 6; i++) {
        if (values[i] >= 0) {
            memset(&state, values[i], sizeof state);
        } else {
            make_bytes((uint8_t *)&state, sizeof state, random);
        }
        trip = at_good;
        measure(&trip, &in);
        require(mpc_depart(&state, &in) == -1, "a departure from bad memory", &state, &out);
        step();
        expect_bad_state("never initialised, and no flag");
        recover("not well after memory that was never initialised");
    }
}

/* Overwrite some bytes of the good state and drive on; returns whether that was found out. */
static int drive_with(size_t at, const void *bytes, size_t count)
{
    state = good;
    trip = at_good;
    memcpy((uint8_t *)&state + at, bytes, count);
    step();
    const int is_found = (out.flags & MPC_BAD_STATE) != 0;
    tried++;
    found_out += is_found;
    if (is_found) {
        expect_bad_state("a plan from bad memory");
    }
    recover("not well after corrupted memory");
    return is_found;
}

static void overwrite(size_t at, uint64_t *random)
{
    static const uint32_t words[] = {0x7FC00000u, 0x7F800000u, 0x7F7FFFFFu, 0x80000000u,
                                     0xFFFFFFFFu, 0u,          1u};
    uint8_t byte = 0;
    make_bytes(&byte, 1, random);
    byte = (uint8_t)(((const uint8_t *)&good)[at] ^ (1u << (byte % 8u)));
    (void)drive_with(at, &byte, 1);
    if (at % sizeof(mpc_real) == 0) {
        const uint32_t word = words[(at / sizeof(mpc_real)) % 7];
        uint32_t number[2] = {word, word};
        number[0] = (sizeof(mpc_real) == 8) ? 0u : word; /* little-endian */
        number[1] = (word == 0x7FC00000u) ? 0x7FF80000u : word;
        number[1] = (word == 0x7F800000u) ? 0x7FF00000u : number[1];
        (void)drive_with(at, number, sizeof(mpc_real));
    }
}

/* Every count, out of its range either way. */
static void counts(void)
{
    const size_t places[] = {offsetof(mpc_state, old_age),
                             offsetof(mpc_state, old_arrival_s),
                             offsetof(mpc_state, old_fast_s),
                             offsetof(mpc_state, road_age),
                             offsetof(mpc_state, phase),
                             offsetof(mpc_state, failures),
                             offsetof(mpc_state, solves),
                             offsetof(mpc_state, is_under_way),
                             offsetof(mpc_state, depart_linearisation),
                             offsetof(mpc_state, depart_left),
                             offsetof(mpc_state, watch.good.engine_on),
                             offsetof(mpc_state, watch.command_on),
                             offsetof(mpc_state, watch.soc_since_s),
                             offsetof(mpc_state, watch.t_cl_since_s),
                             offsetof(mpc_state, watch.has_clock),
                             offsetof(mpc_state, heard.age),
                             offsetof(mpc_state, rules.power_request),
                             offsetof(mpc_state, rules.heat_request),
                             offsetof(mpc_state, watch.good.engine_for_s),
                             offsetof(mpc_state, magic),
                             offsetof(mpc_state, magic_end)};
    const int32_t values[] = {INT32_MIN, -1, INT32_MAX};
    for (size_t i = 0; i < sizeof places / sizeof places[0]; i++) {
        for (size_t k = 0; k < 3; k++) {
            require(drive_with(places[i], &values[k], sizeof values[k]),
                    "a count out of range, and no flag", &state, &out);
        }
    }
}

int main(int argc, char **argv)
{
    static const uint8_t some[64] = {3, 7, 1, 2, 3, 4, 0, 100, 200};
    source from = {some, sizeof some};
    uint64_t random = 1;
    const size_t stride = (argc == 2) ? strtoul(argv[1], NULL, 10) : 0;
    if (stride == 0) {
        return 2;
    }
    trip.car.soc = 0.6;
    trip.car.t_cl_degc = 60;
    take_road(&trip, &from);
    mpc_init(&state);
    for (int k = 0; k < 20; k++) {
        step();
    }
    require(out.rung == MPC_OPTIMISED && out.flags == 0, "no good state", &state, &out);
    good = state;
    at_good = trip;
    never_initialised(&random);
    counts();
    const size_t begin = offsetof(mpc_state, stage);
    const size_t end = offsetof(mpc_state, origin_soc);
    for (size_t at = 0; at < sizeof state; at += (at >= begin && at < end) ? stride : 1) {
        overwrite(at, &random);
    }
    printf("%ld tried, %ld found out\n", tried, found_out);
    return 0;
}
