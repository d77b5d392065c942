/* Any bytes in -> a finite, in-range command and a declared status.
 *
 * The bytes are read as a sequence of calls: one byte selects mpc_init, mpc_depart or mpc_step, the
 * following ones are copied over the inputs or set one number of them; the others are unchanged. So
 * inputs near sensible ones occur as well as nonsense. Built with libFuzzer, or with -DFUZZ_MAIN as
 * a program that makes its own bytes: fuzz_step SEED RUNS.
 */
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "mpc.h"
#include "mpc_model.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void check(const mpc_in *in, const mpc_out *out, int32_t flags)
{
    const int32_t all = MPC_BAD_MEASUREMENT | MPC_BAD_PREVIEW | MPC_SOLVER_FAILED | MPC_WARMING_UP;
    int fine = 1;
    (void)in;
    fine &= (out->engine_on == 0) || (out->engine_on == 1);
    fine &= (out->p_eng_w >= (mpc_real)0) && (out->p_eng_w <= mpc_par.engine_max_w);
    fine &= (out->engine_on == 1) || !(out->p_eng_w > (mpc_real)0);
    fine &= (out->engine_on == 0) || (out->p_eng_w >= mpc_par.engine_min_w);
    fine &= (out->rung >= MPC_OPTIMISED) && (out->rung <= MPC_RULES);
    fine &= (out->flags == flags) && ((flags & ~all) == 0);
    fine &= (out->rung != MPC_OPTIMISED) || (flags == 0);
    fine &= (out->on_share * (mpc_real)0 == (mpc_real)0); /* neither infinite nor NaN */
    fine &= (out->relaxation_gap * (mpc_real)0 == (mpc_real)0);
    if (!fine) {
        abort();
    }
}

static void sensible(mpc_in *in)
{
    memset(in, 0, sizeof(*in));
    in->soc = (mpc_real)0.6;
    in->t_cl_degc = (mpc_real)50;
    in->demand_w = (mpc_real)5000;
    in->speed_mps = (mpc_real)10;
    in->short_count = MPC_SHORT;
    for (int k = 0; k < MPC_SHORT; k++) {
        in->short_demand_w[k] = (mpc_real)5000;
        in->short_speed_mps[k] = (mpc_real)10;
    }
    for (int k = 0; k < MPC_LONG; k++) {
        in->long_duration_s[k] = (mpc_real)30;
        in->long_net_w[k] = (mpc_real)4000;
        in->long_speed_mps[k] = (mpc_real)10;
        in->long_internal_off_w[k] = (mpc_real)4100;
    }
}

/* One number of the inputs: mostly allowed values, at the edges too. */
static void set_real(mpc_in *in, size_t at, uint8_t choice)
{
    static const mpc_real values[] = {
        (mpc_real)0,    (mpc_real)1,     (mpc_real)-1,   (mpc_real)0.4, (mpc_real)0.6,
        (mpc_real)0.8,  (mpc_real)1e-30, (mpc_real)1e-3, (mpc_real)5,   (mpc_real)30,
        (mpc_real)90,   (mpc_real)120,   (mpc_real)150,  (mpc_real)-60, (mpc_real)1e3,
        (mpc_real)-3e4, (mpc_real)2.7e4, (mpc_real)7e4,  (mpc_real)1e5, (mpc_real)-1e5,
        (mpc_real)1e6,  (mpc_real)-1e6,  (mpc_real)1e9,  (mpc_real)1e38};
    const size_t offset = at - (at % sizeof(mpc_real));
    const mpc_real value = values[choice % (sizeof(values) / sizeof(values[0]))];
    if (offset < offsetof(mpc_in, short_count)) {
        memcpy((uint8_t *)in + offset, &value, sizeof(value));
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static mpc_state state;
    mpc_in in;
    mpc_out out;
    mpc_init(&state);
    sensible(&in);
    while (size > 3) {
        const uint8_t call = data[0];
        const size_t at = ((size_t)data[1] * 256u + data[2]) % sizeof(in);
        size_t count = data[3] % 64u;
        data += 4;
        size -= 4;
        count = (count < size) ? count : size;
        count = (count < sizeof(in) - at) ? count : (sizeof(in) - at);
        if ((call & 1u) == 0u) {
            memcpy((uint8_t *)&in + at, data, count);
        } else {
            set_real(&in, at, (count > 0) ? data[0] : 0u);
        }
        data += count;
        size -= count;
        if (call < 8) {
            mpc_init(&state);
            sensible(&in);
        } else if (call < 24) {
            (void)mpc_depart(&state, &in);
        } else {
            memset(&out, 0xff, sizeof(out));
            check(&in, &out, mpc_step(&state, &in, &out));
        }
    }
    return 0;
}

#ifdef FUZZ_MAIN
#include <stdio.h>

int main(int argc, char **argv)
{
    if (argc != 3) {
        return 2;
    }
    uint64_t random = strtoull(argv[1], NULL, 10) * 2u + 1u;
    const long runs = strtol(argv[2], NULL, 10);
    static uint8_t bytes[2048];
    for (long run = 0; run < runs; run++) {
        for (size_t i = 0; i < sizeof(bytes); i++) {
            random = random * 6364136223846793005u + 1442695040888963407u;
            bytes[i] = (uint8_t)(random >> 56);
        }
        (void)LLVMFuzzerTestOneInput(bytes, sizeof(bytes));
    }
    printf("%ld runs\n", runs);
    return 0;
}
#endif
