/* Safety layer: the command of one second that keeps the limits, else comes nearest to them.
 *
 * Whatever the optimiser returned, the result is finite and in range, the engine is on where the car
 * is too fast for one that is off, and no other such command exceeds the limits by less: first battery and engine power, then SOC, then coolant; where all are kept,
 * in the same order the limits drawn in by a margin. Of such commands it takes the one nearest to
 * the wish: the same on or off where possible, then the nearest power. While the shortest run or
 * rest of the engine is not over, the wish is that it goes on as it does.
 */
#include "mpc_constants.h"
#include "mpc_heat.h"
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"
#include "mpc_must_run.h"

#define LIMITS 3
#define NEVER_W REAL(1.0e9)

/* Engine powers, W, that keep one pair of limits. */
typedef struct {
    mpc_real low;
    mpc_real high;
} interval;

/* Heat of the running engine: (1 - x) (LHV (alpha f(P) + start) - P). */
typedef struct {
    mpc_real factor;
    mpc_real start_w;
} engine_heat;

static mpc_real distance(interval of, mpc_real value)
{
    return real_max(real_max(of.low - value, value - of.high), REAL(0.0));
}

/* The part of `own` inside `to`; if there is none, its nearest point. */
static interval narrowed(interval own, interval to)
{
    const interval both = {real_min(real_max(own.low, to.low), own.high),
                           real_max(real_min(own.high, to.high), own.low)};
    return both;
}

/* With the lower end raised, to the upper one at most. */
static interval raised(interval of, mpc_real by)
{
    const interval result = {real_min(of.low + by, of.high), of.high};
    return result;
}

/* The engine's own powers, from the last one no further up than its ramp. */
static interval of_engine(const mpc_measured *seen, mpc_real ramp_w_per_s)
{
    const mpc_real before_w = (seen->engine_on != 0) ? seen->p_eng_before_w : REAL(0.0);
    const mpc_real ramped_w = (before_w + ramp_w_per_s) - POWER_MARGIN_W;
    const interval allowed = {mpc_par.engine_min_w,
                              real_clip(ramped_w, mpc_par.engine_min_w, mpc_par.engine_max_w)};
    return allowed;
}

/* Engine on or off, and its power if on; as before while its shortest run or rest lasts. */
static mpc_command lasting(mpc_command wish, const mpc_measured *seen)
{
    const int32_t shortest_s = (seen->engine_on != 0) ? mpc_par.min_on_s : mpc_par.min_off_s;
    const int32_t lasts = (seen->engine_for_s < shortest_s) ? 1 : 0;
    mpc_command result = {REAL(0.0), (lasts != 0) ? seen->engine_on : wish.engine_on};
    if (wish.engine_on != 0) {
        result.p_eng_w = (wish.p_eng_w >= REAL(0.0)) ? wish.p_eng_w : REAL(0.0); /* nor NaN */
    } else if ((result.engine_on != 0) && (seen->p_eng_before_w < mpc_par.engine_max_w)) {
        result.p_eng_w = seen->p_eng_before_w; /* the greatest stands for one that is not known */
    } else {
        /* the least that will do */
    }
    return result;
}

/* Brakes take braking power that the battery cannot: it then has to take P_eng - P_aux at most.
 * Here as for SOC the power that cranks a starting engine is left out: it raises the lower end, but
 * never helps to discharge. */
static interval of_battery(const mpc_measured *seen, mpc_real margin)
{
    const mpc_real net_w = seen->demand_w + mpc_par.aux_power_w;
    const mpc_real drawn_w = margin * POWER_MARGIN_W;
    const interval allowed = {(net_w - mpc_par.battery_discharge_max_w) + drawn_w,
                              (real_max(net_w, mpc_par.aux_power_w) + mpc_par.battery_charge_max_w)
                                  - drawn_w};
    return allowed;
}

static interval of_soc(const mpc_measured *seen, const mpc_calibration *cal, mpc_real margin)
{
    const mpc_real net_w = seen->demand_w + mpc_par.aux_power_w;
    const mpc_real drawn = margin * SOC_MARGIN;
    const mpc_real emptying_w =
        real_max(mpc_map_power_to_reach_w(seen->soc, cal->soc_min + drawn),
                 -mpc_par.battery_charge_max_w); /* far below: as fast as can be */
    const mpc_real filling_w = mpc_map_power_to_reach_w(seen->soc, cal->soc_max - drawn);
    interval allowed;
    if (filling_w <= REAL(0.0)) {
        allowed.high = real_max(net_w, mpc_par.aux_power_w) - filling_w;
    } else { /* too full: to be discharged by the demand; while braking, not to be charged */
        const mpc_real discharged_w = net_w - filling_w;
        allowed.high = (net_w > REAL(0.0)) ? discharged_w : mpc_par.aux_power_w;
    }
    allowed.low = real_min(net_w - emptying_w, allowed.high);
    return allowed;
}

static mpc_real heat_at(const engine_heat *heat, int32_t i)
{
    return heat->start_w
           + heat_engine_w(heat->factor * mpc_par.fuel_g_per_s[i],
                           (mpc_real)i * mpc_par.fuel_step_w);
}

/* Engine power that gives this heat; heat grows with power. Always the same number of steps. */
static mpc_real power_for_heat_w(const engine_heat *heat, mpc_real heat_w)
{
    int32_t below = 0; /* the last point with no more heat */
    for (int32_t stride = MPC_FUEL_STRIDE; stride > 0; stride /= 2) {
        const int32_t i = below + stride;
        if ((i < (MPC_FUEL_POINTS - 1)) && (heat_at(heat, i) <= heat_w)) {
            below = i;
        }
    }
    const mpc_real least = heat_at(heat, below);
    const mpc_real step = heat_at(heat, below + 1) - least;
    const mpc_real power_w = mpc_par.fuel_step_w * ((mpc_real)below + ((heat_w - least) / step));
    mpc_real result = power_w;
    if (heat_w < least) {
        result = -NEVER_W;
    } else if (power_w > mpc_par.engine_max_w) {
        result = NEVER_W;
    } else {
        /* there is one */
    }
    return result;
}

/* Heat of the engine after which the coolant lies in its limits. */
static interval of_heat(const mpc_measured *seen, const mpc_calibration *cal, mpc_real margin)
{
    const mpc_real out_w = heat_cooling_w(seen->t_cl_degc, seen->speed_mps);
    const mpc_real drawn_k = margin * T_CL_MARGIN_K;
    const mpc_real low_k = (cal->t_cl_min_degc - seen->t_cl_degc) + drawn_k;
    const mpc_real high_k = (cal->t_cl_max_degc - seen->t_cl_degc) - drawn_k;
    const interval allowed = {out_w + (low_k * mpc_par.heat_capacity_j_per_k),
                              out_w + (high_k * mpc_par.heat_capacity_j_per_k)};
    return allowed;
}

/* Whether on or off exceeds the limits by less, in order of priority; the wish if neither. */
static int32_t better(int32_t wish, const mpc_real *on, const mpc_real *off)
{
    int32_t choice = wish;
    for (int32_t i = (2 * LIMITS) - 1; i >= 0; i--) {
        if (on[i] < off[i]) {
            choice = 1;
        } else if (off[i] < on[i]) {
            choice = 0;
        } else {
            /* the lower priorities decide */
        }
    }
    return choice;
}

mpc_command mpc_safety_admissible(mpc_command wish, const mpc_measured *seen,
                                  const mpc_calibration *cal)
{
    const mpc_real start_g = (seen->engine_on != 0) ? REAL(0.0) : cal->start_fuel_g;
    const mpc_real factor = mpc_map_cold_factor(seen->t_cl_degc) * mpc_par.lhv_j_per_g;
    const engine_heat heat = {factor * cal->fuel_scale,
                              heat_engine_w(mpc_par.lhv_j_per_g * start_g, REAL(0.0))};
    const mpc_real cranking_w = (seen->engine_on != 0) ? REAL(0.0) : mpc_par.start_energy_j;
    interval running = of_engine(seen, cal->ramp_w_per_s);
    mpc_real on[2 * LIMITS];
    mpc_real off[2 * LIMITS];
    for (int32_t tier = 0; tier < 2; tier++) {
        const mpc_real margin = (mpc_real)tier;
        interval powers[LIMITS - 1];
        powers[0] = of_battery(seen, margin);
        powers[1] = of_soc(seen, cal, margin);
        const int32_t first = tier * LIMITS;
        for (int32_t i = 0; i < (LIMITS - 1); i++) {
            const interval powers_on = raised(powers[i], cranking_w);
            running = narrowed(running, powers_on);
            on[first + i] = distance(powers_on, running.low);
            off[first + i] = distance(powers[i], REAL(0.0));
        }
        const interval warmth = of_heat(seen, cal, margin);
        const interval by_heat = {power_for_heat_w(&heat, warmth.low),
                                  power_for_heat_w(&heat, warmth.high)};
        running = narrowed(running, by_heat);
        const mpc_real fuel = mpc_map_fuel_g_per_s(running.low);
        const mpc_real made_w = heat.start_w + heat_engine_w(heat.factor * fuel, running.low);
        /* within what the inverse resolves, it is kept */
        const int32_t kept = ((by_heat.low <= running.low) && (running.low <= by_heat.high)) ? 1
                                                                                             : 0;
        on[first + LIMITS - 1] = (kept != 0) ? REAL(0.0) : distance(warmth, made_w);
        off[first + LIMITS - 1] = distance(warmth, REAL(0.0));
    }
    const mpc_command wanted = lasting(wish, seen);
    mpc_command command = {REAL(0.0), 0};
    if ((better(wanted.engine_on, on, off) | is_too_fast(seen->speed_mps)) != 0) {
        command.engine_on = 1;
        command.p_eng_w = real_clip(wanted.p_eng_w, running.low, running.high);
    }
    return command;
}
