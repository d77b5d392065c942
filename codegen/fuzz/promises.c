#include "promises.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "every_command.h"
#include "mpc_model.h"

/* W, 1 and K: rounding of the controller's own arithmetic */
static const double tolerance[] = {MPC_F32 ? 0.05 : 1e-6, MPC_F32 ? 1e-6 : 1e-10,
                                   MPC_F32 ? 1e-3 : 1e-8};

void require(int fine, const char *what, const mpc_state *state, const mpc_out *out)
{
    const mpc_measured *const used = &state->watch.good;
    if (!fine) {
        fprintf(stderr, "%s; flags %d rung %d on %d power %.9g\n", what, (int)out->flags,
                (int)out->rung, (int)out->engine_on, (double)out->p_eng_w);
        fprintf(stderr, "used: SOC %.9g coolant %.9g demand %.9g speed %.9g\n", (double)used->soc,
                (double)used->t_cl_degc, (double)used->demand_w, (double)used->speed_mps);
        fprintf(stderr, "on %d for %d s, power before %.9g\n", (int)used->engine_on,
                (int)used->engine_for_s, (double)used->p_eng_before_w);
        abort();
    }
}

static int same(mpc_real a, mpc_real b) { return memcmp(&a, &b, sizeof a) == 0; }

static int is_declared(const mpc_out *out)
{
    const int32_t unusable = MPC_SOLVER_FAILED | MPC_WARMING_UP;
    const int has_solved = out->iterations == MPC_ITERATIONS;
    int fine = out->rung >= MPC_OPTIMISED && out->rung <= MPC_RULES && (out->flags >> FLAGS) == 0;
    fine &= has_solved || (out->iterations == 0 && (out->flags & MPC_BAD_PREVIEW));
    fine &= has_solved || !(out->flags & unusable);
    fine &= (out->rung == MPC_OPTIMISED) == (has_solved && !(out->flags & unusable));
    /* a method that warms up has no plan in its first second */
    const int has_plan = MPC_WARM_UP_STEPS <= 1 || !(out->flags & MPC_BAD_STATE);
    return fine && (out->rung == MPC_RULES || has_plan);
}

static int is_in_range(const second_start *told, const mpc_out *out)
{
    const int is_on = out->engine_on == 1 && out->p_eng_w >= mpc_par.engine_min_w
                      && (double)out->p_eng_w <= greatest_w(told) + tolerance[0];
    const int is_off = out->engine_on == 0 && same(out->p_eng_w, 0);
#if MPC_COSTATE
    const mpc_real proof = out->certificate_g;
#else
    const mpc_real proof = out->relaxation_gap;
#endif
    return (is_on || is_off) && isfinite(out->on_share) && isfinite(proof);
}

static int is_as_given(const mpc_measured *used, const mpc_in *in)
{
    return same(used->soc, in->soc) && same(used->t_cl_degc, in->t_cl_degc)
           && same(used->demand_w, in->demand_w) && same(used->speed_mps, in->speed_mps)
           && used->engine_on == in->engine_on;
}

/* The calibration is taken over as a whole, or one of its entries is refused. */
static int is_calibrated(const mpc_state *state, const mpc_out *out)
{
    const int is_used = memcmp(&state->cal, &state->calibration, sizeof state->cal) == 0;
    const int is_named = out->wrong_entry >= 0 && out->wrong_entry < MPC_CAL_ENTRIES;
    const int is_refused = (out->flags & MPC_BAD_CALIBRATION) != 0;
    return is_refused ? is_named : (is_used && out->wrong_entry == -1);
}

void check_promises(const mpc_state *state, const mpc_in *in, const mpc_out *out, int32_t returned)
{
    static const char *const names[] = {"avoidable: power", "avoidable: SOC", "avoidable: coolant"};
    const mpc_measured *const used = &state->watch.good;
    const second_start told = {(double)used->soc,      (double)used->t_cl_degc,
                               (double)used->demand_w, (double)used->speed_mps,
                               used->engine_on,        (double)used->p_eng_before_w,
                               used->engine_for_s,     &state->cal};
    require(out->flags == returned && is_declared(out), "undeclared status", state, out);
    require(is_in_range(&told, out), "command out of range", state, out);
    require((out->flags & MPC_BAD_MEASUREMENT) || is_as_given(used, in),
            "a measurement replaced without a flag", state, out);
    require(is_calibrated(state, out), "a calibration neither used nor refused", state, out);
    const int limit = avoidable(&told, out, tolerance);
    require(limit < 0, names[(limit < 0) ? 0 : limit], state, out);
    require(!cut_short(&told, out), "a run or rest cut short", state, out);
}
