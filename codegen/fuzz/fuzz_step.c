/* Seconds of a simulated car, plausible and hostile, against the promises of mpc_step.
 *
 * Bytes become trips with a forecast, a clock, and a car that moves as commanded; in some seconds
 * numbers, clock, preview or memory are attacked. After every step: the command is finite and in
 * range, the status is declared, no other command would exceed the limits of the second by less,
 * and after some quiet seconds all is well again. Built with libFuzzer, or with -DFUZZ_MAIN as a
 * program that makes its own bytes and counts what it has reached: fuzz_step SEED STEPS.
 */
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "every_command.h"
#include "mpc_model.h"
#include "road.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define FLAGS 6
#define QUIET_S                                                                                    \
    (3 + MPC_WARM_UP_STEPS) /* bad state or failure, then cold: after that all is well */

/* W, 1 and K: rounding of the controller's own arithmetic */
static const double tolerance[] = {MPC_F32 ? 0.05 : 1e-6, MPC_F32 ? 1e-6 : 1e-10,
                                   MPC_F32 ? 1e-3 : 1e-8};

static struct {
    long steps;
    long solved; /* steps with iterations of the solver */
    long rung[3];
    long flag[FLAGS];
} reached;

static mpc_state state;
static mpc_forecast forecast;
static mpc_road road;
static second_start car;
static int32_t place;   /* seconds of the trip driven */
static int32_t clock_s; /* its clock is ahead by */
static int32_t quiet_s; /* since the last attack */
static int32_t blind_s; /* no preview for */
static mpc_in in;
static mpc_out out;

static void require(int fine, const char *what)
{
    if (!fine) {
        fprintf(stderr, "step %ld: %s; flags %d rung %d on %d power %.9g\n", reached.steps, what,
                (int)out.flags, (int)out.rung, (int)out.engine_on, (double)out.p_eng_w);
        fprintf(stderr, "told: SOC %.9g coolant %.9g demand %.9g speed %.9g on %d\n",
                (double)state.watch.good.soc, (double)state.watch.good.t_cl_degc,
                (double)state.watch.good.demand_w, (double)state.watch.good.speed_mps,
                (int)state.watch.good.engine_on);
        abort();
    }
}

static int same(mpc_real a, mpc_real b) { return memcmp(&a, &b, sizeof a) == 0; }

static void check_measured(void)
{
    const mpc_measured *used = &state.watch.good;
    require(same(used->soc, in.soc) && same(used->t_cl_degc, in.t_cl_degc)
                && same(used->demand_w, in.demand_w) && same(used->speed_mps, in.speed_mps)
                && used->engine_on == in.engine_on,
            "a measurement was replaced and not flagged");
}

static void check(int32_t flags)
{
    const mpc_measured *used = &state.watch.good;
    const second_start told = {(double)used->soc, (double)used->t_cl_degc, (double)used->demand_w,
                               (double)used->speed_mps, used->engine_on};
    const int32_t unusable = MPC_SOLVER_FAILED | MPC_WARMING_UP;
    require(out.flags == flags && (flags >> FLAGS) == 0, "undeclared flags");
    require(out.rung >= MPC_OPTIMISED && out.rung <= MPC_RULES, "undeclared rung");
    require(out.engine_on == 0 || out.engine_on == 1, "engine neither on nor off");
    require(out.engine_on ? out.p_eng_w >= mpc_par.engine_min_w : same(out.p_eng_w, 0),
            "too little power");
    require(out.p_eng_w <= mpc_par.engine_max_w, "too much power");
    require(isfinite(out.on_share) && isfinite(out.relaxation_gap), "not finite");
    require(out.iterations == 0 || out.iterations == MPC_ITERATIONS, "iterations");
    require(out.iterations > 0 || (flags & MPC_BAD_PREVIEW), "no solve and no reason");
    require(out.iterations > 0 || !(flags & unusable), "no solve and its failure");
    require((out.rung == MPC_OPTIMISED) == (out.iterations > 0 && !(flags & unusable)), "rung");
    require(!(flags & MPC_BAD_STATE) || out.rung == MPC_RULES, "a plan from bad memory");
    if (!(flags & MPC_BAD_MEASUREMENT)) {
        check_measured();
    }
    const int limit = avoidable(&told, &out, tolerance);
    static const char *const names[] = {"avoidable: power", "avoidable: SOC", "avoidable: coolant"};
    require(limit < 0, names[(limit < 0) ? 0 : limit]);
    require(quiet_s < QUIET_S || flags == 0, "all was well, and a flag");
}

static void count(void)
{
    reached.steps++;
    reached.solved += out.iterations > 0;
    reached.rung[out.rung]++;
    for (int i = 0; i < FLAGS; i++) {
        reached.flag[i] += (out.flags >> i) & 1;
    }
}

static void move_car(int32_t seconds)
{
    for (int32_t k = 0; k < seconds && place < road.steps; k++) {
        car.demand_w = (double)road.demand_w[place];
        car.speed_mps = (double)road.speed_mps[place];
        car = second_later(&car, out.engine_on, (double)out.p_eng_w);
        place++;
    }
}

/* SOC and coolant anywhere, often at a limit. */
static void place_car(source *from)
{
    const double limits[] = {0, (double)mpc_par.soc_min, (double)mpc_par.soc_max, 1};
    const double coolant[] = {(double)mpc_par.t_cl_min_degc, (double)mpc_par.t_cl_max_degc};
    const double aside = between(from, -1e-3, 1e-3);
    car.soc = below(from, 2) ? between(from, 0, 1) : limits[below(from, 4)] + aside;
    car.soc = fmin(fmax(car.soc, 0), 1);
    car.t_cl_degc = below(from, 2) ? between(from, -60, 130)
                                   : coolant[below(from, 2)] + 1e3 * aside;
}

static void measure(void)
{
    (void)mpc_in_from_forecast(&forecast, place, &in);
    in.soc = (mpc_real)car.soc;
    in.t_cl_degc = (mpc_real)car.t_cl_degc;
    in.demand_w = road.demand_w[place];
    in.speed_mps = road.speed_mps[place];
    in.engine_on = car.engine_on;
    in.second = (int32_t)((uint32_t)place + (uint32_t)clock_s);
}

/* A trip starts, with a departure or part of one, or without. */
static void start(source *from)
{
    road = new_road(from);
    (void)mpc_forecast_start(&forecast, &road);
    place = 0;
    clock_s = 0;
    car.engine_on = 0;
    if (below(from, 2)) {
        place_car(from);
    }
    mpc_init(&state);
    measure();
    for (uint32_t slice = below(from, 4); slice > 0; slice--) {
        const int32_t left = mpc_depart(&state, &in);
        require(left == 0 || left == 1, "departure refused");
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

static void fill_state(source *from)
{
    static const uint8_t values[] = {0, 0xFF, 0x55};
    const uint32_t kind = below(from, 4);
    uint64_t random = bits(from);
    for (size_t i = 0; i < sizeof state; i++) {
        random = random * 6364136223846793005u + 1442695040888963407u;
        ((uint8_t *)&state)[i] = (kind < 3) ? values[kind] : (uint8_t)(random >> 56);
    }
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
    }
}

static void attack_inputs(source *from)
{
    const size_t at = below(from, sizeof in);
    size_t count = below(from, 64);
    count = (count < sizeof in - at) ? count : sizeof in - at;
    count = (count < from->left) ? count : from->left;
    memcpy((uint8_t *)&in + at, from->at, count);
    from->at += count;
    from->left -= count;
}

/* One attack; returns for how long its traces may be seen. */
static int32_t attack(source *from)
{
    int32_t traces_s = 0;
    mpc_real *const numbers = (mpc_real *)&in;
    switch (below(from, 16)) {
    case 0: /* one of the measurements */
        numbers[below(from, 4)] = hostile(from);
        traces_s = 150; /* until the truth is within reach of what may have been believed */
        break;
    case 1:
        in.soc += (mpc_real)between(from, -0.02, 0.02);
        in.t_cl_degc += (mpc_real)between(from, -4, 4);
        traces_s = 150;
        break;
    case 2: /* any number */
        numbers[below(from, offsetof(mpc_in, short_count) / sizeof in.soc)] = hostile(from);
        traces_s = 150;
        break;
    case 3:
        attack_inputs(from);
        traces_s = 150;
        break;
    case 4:
        in.short_count = (int32_t)bits(from);
        blind_s = below(from, 2) ? (int32_t)below(from, 2 * MPC_SHORT) : 0;
        traces_s = blind_s;
        break;
    case 5:
        in.engine_on = below(from, 2) ? 1 - car.engine_on : (int32_t)bits(from);
        break;
    case 6: /* the clock jumps, for good */
        clock_s = below(from, 2) ? clock_s - (int32_t)below(from, 40) : (int32_t)bits(from);
        in.second = (int32_t)((uint32_t)place + (uint32_t)clock_s);
        break;
    case 7: /* seconds are missed */
        move_car((int32_t)below(from, 26));
        if (place == road.steps) {
            start(from);
        }
        measure();
        traces_s = 150;
        break;
    case 8: /* this second again */
        place -= (place > 0) ? 1 : 0;
        measure();
        break;
    case 9:
        attack_preview(from);
        break;
    case 10: { /* a new route under way */
        const int32_t now = place + clock_s;
        road = new_road(from);
        (void)mpc_forecast_start(&forecast, &road);
        place = 0;
        clock_s = now;
        measure();
        break;
    }
    case 11:
        place_car(from);
        measure();
        traces_s = 150;
        break;
    case 12:
        start(from);
        break;
    case 13: /* the solver's numbers */
        state.stage[below(from, MPC_STAGES)].x[below(from, MPC_VARS)] = hostile(from);
        break;
    case 14:
        poke(from);
        traces_s = 150;
        break;
    default:
        fill_state(from);
        require(mpc_depart(&state, &in) == -1, "a departure from bad memory");
        break;
    }
    return traces_s;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    source from = {data, size};
    place_car(&from);
    start(&from);
    while (from.left > 0) {
        const uint32_t next = below(&from, 256);
        const int32_t calm_s = (next < 16) ? 2 * (int32_t)next : 0; /* none of them attacked */
        for (int32_t k = 0; k <= calm_s; k++) {
            if (place == road.steps) {
                start(&from);
            }
            measure();
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
            check(mpc_step(&state, &in, &out));
            count();
            move_car(1);
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
        for (size_t i = 0; i < sizeof bytes; i++) {
            random = random * 6364136223846793005u + 1442695040888963407u;
            bytes[i] = (uint8_t)(random >> 56);
        }
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
