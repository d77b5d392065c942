/* Seconds of a simulated car, plausible and hostile, against the promises of mpc_step.
 *
 * Bytes become trips with a forecast, a clock, and a car that moves as commanded; in some seconds
 * numbers, clock, preview or memory are attacked. After every step: the command is finite and in
 * range, the status is declared, no other command would exceed the limits of the second by less,
 * and after some quiet seconds of a road that the car can follow all is well again. Built with
 * libFuzzer, or with -DFUZZ_MAIN as a program that makes its own bytes and counts what it has
 * reached: fuzz_step SEED STEPS.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drive.h"
#include "mpc_constants.h"
#include "mpc_model.h"
#include "promises.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* A wrong number of the solver is noticed, failures are forgiven, it starts cold: then all is well. */
#define QUIET_S (4 + FAILURES_FORGIVEN + MPC_WARM_UP_STEPS)
/* Until the truth is within reach of whatever may have been believed. */
#define LONG_S 150

static struct {
    long steps;
    long solved; /* steps with iterations of the solver */
    long rung[3];
    long flag[FLAGS];
} reached;

static mpc_state state;
static drive trip;
static int32_t quiet_s; /* since the last attack */
static int32_t blind_s; /* no preview for */
static mpc_in in;
static mpc_out out;

static void count(void)
{
    reached.steps++;
    reached.solved += out.iterations > 0;
    reached.rung[out.rung]++;
    for (int i = 0; i < FLAGS; i++) {
        reached.flag[i] += (out.flags >> i) & 1;
    }
}

/* A trip starts, with a departure or part of one, or without. */
static void start(source *from)
{
    take_road(&trip, from);
    if (below(from, 2)) {
        place_car(&trip, from);
    }
    mpc_init(&state);
    measure(&trip, &in);
    for (uint32_t slice = below(from, 4); slice > 0; slice--) {
        const int32_t left = mpc_depart(&state, &in);
        require(left == 0 || left == 1, "departure refused", &state, &out);
    }
    quiet_s = 0;
    blind_s = 0;
}

static void poke(source *from)
{
    const size_t word = below(from, sizeof state / sizeof(mpc_real));
    const mpc_real number = hostile(from);
    uint8_t *const bytes = (uint8_t *)&state;
    if (below(from, 2)) {
        memcpy(&bytes[word * sizeof number], &number, sizeof number);
    } else {
        bytes[word * sizeof number + below(from, sizeof number)] ^= (uint8_t)(1u << below(from, 8));
    }
}

static void fill(void *memory, size_t size, source *from)
{
    static const uint8_t values[] = {0, 0xFF, 0x55};
    const uint32_t kind = below(from, 4);
    uint64_t random = bits(from);
    if (kind < 3) {
        memset(memory, values[kind], size);
    } else {
        make_bytes(memory, size, &random);
    }
}

static void attack_memory(source *from)
{
    if (below(from, 2)) {
        fill(&state, sizeof state, from);
        require(mpc_depart(&state, &in) == -1, "a departure from bad memory", &state, &out);
    } else {
        const int32_t now = in.second;
        fill(&trip.forecast, sizeof trip.forecast, from);
        require(mpc_in_from_forecast(&trip.forecast, trip.place, &in) == -1
                    && mpc_in_from_preview(&trip.forecast, trip.place, trip.place, &trip.road, &in)
                           == -1,
                "a preview from bad memory", &state, &out);
        in.second = now;
        (void)mpc_forecast_start(&trip.forecast, &trip.road);
    }
}

/* The clock jumps, for good. */
static void attack_clock(source *from)
{
    const uint32_t ahead = (uint32_t)trip.clock_s;
    trip.clock_s = (int32_t)(below(from, 2) ? ahead - below(from, 40) : bits(from));
    measure(&trip, &in);
}

static void attack_preview(source *from)
{
    const mpc_real wild_w[] = {mpc_par.can_net_min_w, 0, mpc_par.can_net_max_w};
    const uint32_t first = below(from, 3);
    const uint32_t turn = below(from, 3);
    for (uint32_t k = 0; k < MPC_SHORT; k++) {
        in.short_demand_w[k] = wild_w[(first + k * turn) % 3];
        in.short_speed_mps[k] = (k % 2) ? mpc_par.can_speed_max_mps : 0;
    }
    for (uint32_t k = 0; k < MPC_LONG; k++) {
        in.long_duration_s[k] = (mpc_real)between(from, 0, 3000);
        in.long_net_w[k] = wild_w[(first + k * turn) % 3];
        in.long_internal_off_w[k] = (k % 2) ? mpc_par.can_internal_min_w
                                            : mpc_par.can_internal_max_w;
        in.long_must_share[k] = (mpc_real)between(from, 0, 1);
        in.long_free_net_w[k] = wild_w[(first + turn + k) % 3];
        in.long_free_internal_off_w[k] = (k % 3) ? mpc_par.can_internal_min_w
                                                 : mpc_par.can_internal_max_w;
        in.long_rises[k] = (mpc_real)between(from, 0, 3000);
        in.long_fall_j[k] = (mpc_real)between(from, 0, 1) * mpc_par.can_energy_j;
        in.long_rise_j[k] = (mpc_real)between(from, 0, 1) * mpc_par.can_energy_j;
    }
    in.short_rise_j = (mpc_real)between(from, 0, 1) * mpc_par.can_energy_j;
}

static void attack_inputs(source *from)
{
    const size_t at = below(from, sizeof in);
    size_t length = below(from, 64);
    length = (length < sizeof in - at) ? length : sizeof in - at;
    length = (length < from->left) ? length : from->left;
    memcpy((uint8_t *)&in + at, from->at, length);
    from->at += length;
    from->left -= length;
}

/* A tool writes a number of the calibration, in its bounds or any. */
static void calibrate(source *from)
{
    const size_t at = below(from, MPC_CAL_ENTRIES);
    const double least = (double)mpc_par.cal_least[at];
    const double most = (double)mpc_par.cal_most[at];
    const mpc_real number = below(from, 4) ? (mpc_real)between(from, least, most) : hostile(from);
    memcpy((uint8_t *)&state.calibration + (at * sizeof number), &number, sizeof number);
}

/* One attack; returns for how long its traces may be seen. */
static int32_t attack(source *from)
{
    int32_t traces_s = 0;
    mpc_real *const numbers = (mpc_real *)&in;
    switch (below(from, 17)) {
    case 0: /* one of the measurements */
        numbers[below(from, 4)] = hostile(from);
        traces_s = LONG_S;
        break;
    case 1:
        in.soc += (mpc_real)between(from, -0.02, 0.02);
        in.t_cl_degc += (mpc_real)between(from, -4, 4);
        traces_s = LONG_S;
        break;
    case 2: /* any number */
        numbers[below(from, offsetof(mpc_in, short_count) / sizeof in.soc)] = hostile(from);
        traces_s = LONG_S;
        break;
    case 3:
        attack_inputs(from);
        traces_s = LONG_S;
        break;
    case 4:
        in.short_count = (int32_t)bits(from);
        blind_s = below(from, 2) ? (int32_t)below(from, 2 * MPC_SHORT) : 0;
        traces_s = blind_s;
        break;
    case 5:
        in.engine_on = below(from, 2) ? 1 - trip.car.engine_on : (int32_t)bits(from);
        break;
    case 6:
        attack_clock(from);
        break;
    case 7: /* seconds are missed */
        move(&trip, &out, (int32_t)below(from, 26));
        if (has_arrived(&trip)) {
            start(from);
        }
        measure(&trip, &in);
        traces_s = LONG_S;
        break;
    case 8: /* this second again */
        trip.place -= (trip.place > 0) ? 1 : 0;
        measure(&trip, &in);
        break;
    case 9:
        attack_preview(from);
        break;
    case 10: /* a new route under way */
        take_road(&trip, from);
        trip.clock_s = in.second;
        measure(&trip, &in);
        break;
    case 11:
        place_car(&trip, from);
        measure(&trip, &in);
        traces_s = LONG_S;
        break;
    case 12:
        start(from);
        break;
    case 13: /* the solver's numbers */
        state.stage[below(from, MPC_STAGES)].x[below(from, MPC_VARS)] = hostile(from);
        break;
    case 14:
        poke(from);
        traces_s = LONG_S;
        break;
    case 15:
        calibrate(from);
        break;
    default:
        attack_memory(from);
        break;
    }
    return traces_s;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    source from = {data, size};
    place_car(&trip, &from);
    start(&from);
    while (from.left > 0) {
        const uint32_t next = below(&from, 256);
        const int32_t calm_s = (next < 16) ? 2 * (int32_t)next : 0; /* none of them attacked */
        for (int32_t k = 0; k <= calm_s; k++) {
            if (has_arrived(&trip)) {
                start(&from);
            }
            measure(&trip, &in);
            quiet_s++;
            if (blind_s > 0) {
                blind_s--;
                in.short_count = 0;
            }
            if (next >= 128) {
                const int32_t until_s = -attack(&from);
                quiet_s = (quiet_s < until_s) ? quiet_s : until_s;
            }
            memset(&out, 0xff, sizeof out);
            check_promises(&state, &in, &out, mpc_step(&state, &in, &out));
            require(quiet_s < QUIET_S || trip.is_wild || out.flags == 0, "all was well, and a flag",
                    &state, &out);
            restore(&state, &out);
            count();
            move(&trip, &out, 1);
        }
    }
    return 0;
}

#ifdef FUZZ_MAIN
int main(int argc, char **argv)
{
    if (argc != 3) {
        return 2;
    }
    uint64_t random = strtoull(argv[1], NULL, 10) * 2u + 1u;
    const long steps = strtol(argv[2], NULL, 10);
    static uint8_t bytes[2048];
    while (reached.steps < steps) {
        make_bytes(bytes, sizeof bytes, &random);
        (void)LLVMFuzzerTestOneInput(bytes, sizeof bytes);
    }
    printf("{\"steps\": %ld, \"solved\": %ld, \"rungs\": [%ld, %ld, %ld], \"flags\": [",
           reached.steps, reached.solved, reached.rung[0], reached.rung[1], reached.rung[2]);
    for (int i = 0; i < FLAGS; i++) {
        printf("%s%ld", i ? ", " : "", reached.flag[i]);
    }
    printf("]}\n");
    return 0;
}
#endif
