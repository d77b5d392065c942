/* Checks of memory and measurements: finite, and possible for this car.
 *
 * A measured SOC or coolant temperature is possible if the car could have got there from the value
 * that the model predicts from the last good one: the reach grows with the seconds since. Else the
 * prediction is used. Demand and speed are possible if the car can do them; else the last good ones
 * are used. Time is counted on where the clock is wrong. The seconds since the engine was started or
 * stopped, and its power in the last second, are known from what was measured and commanded before.
 */
#include "mpc_constants.h"
#include "mpc_heat.h"
#include "mpc_learned.h"
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"

#define NO_VALUE REAL(1.0e20)

static int32_t is_count(int32_t x, int32_t most) { return ((x >= 0) && (x <= most)) ? 1 : 0; }

/* Check of one second of a trip. */
int32_t mpc_check_second(mpc_real demand_w, mpc_real speed_mps)
{
    return within(demand_w, mpc_par.can_demand_min_w, mpc_par.can_demand_max_w)
           & within(speed_mps, REAL(0.0), mpc_par.can_speed_max_mps);
}

/* Whether the memory is that of a controller: initialised, and every count in its range. Numbers
 * of the iterate are checked where they are used. */
int32_t mpc_check_state(const mpc_state *state)
{
    const mpc_watch *const watch = &state->watch;
    const mpc_rule_memory *const rules = &state->rules;
    int32_t fine = ((state->magic == MPC_MAGIC) && (state->magic_end == MPC_MAGIC)) ? 1 : 0;
    fine &= is_count(state->old_age, MPC_NO_PLAN) & is_count(state->road_age, MPC_NO_PLAN)
            & is_count(state->heard.age, MPC_NO_PLAN) & is_count(state->old_arrival_s, MPC_SHORT)
            & is_count(state->old_fast_s, MPC_SHORT);
    fine &= is_count(state->phase, MPC_PHASE_RUNNING) & is_count(state->solves, MPC_WARM_UP_STEPS);
    fine &= is_count(state->failures, FAILURES_FORGIVEN) & is_count(state->is_under_way, 1);
    fine &= is_count(state->depart_linearisation, MPC_DEPARTURE_LINEARISATIONS);
    fine &= is_count(state->depart_left, MPC_DEPARTURE_ITERATIONS);
    fine &= mpc_method_check(state);
    fine &= mpc_calibration_check(&state->cal);
    fine &= is_count(rules->power_request, 1) & is_count(rules->heat_request, 1);
    fine &= is_count(watch->soc_since_s, LONG_AGO_S) & is_count(watch->t_cl_since_s, LONG_AGO_S);
    fine &= is_count(watch->has_clock, 1) & is_count(watch->command_on, 1);
    fine &= within(watch->command_w, REAL(0.0), mpc_par.engine_max_w);
    fine &= within(watch->good.soc, REAL(0.0), REAL(1.0));
    fine &= within(watch->good.t_cl_degc, mpc_par.can_coldest_degc, mpc_par.can_hottest_degc);
    fine &= mpc_check_second(watch->good.demand_w, watch->good.speed_mps);
    fine &= within(watch->good.p_eng_before_w, REAL(0.0), mpc_par.engine_max_w);
    fine &= is_count(watch->good.engine_for_s, LONG_AGO_S);
#if MPC_LEARNING
    fine &= within(watch->good.fuel_g, REAL(-1.0), mpc_par.learned_most_g);
    fine &= mpc_learned_check(state);
#endif
    return fine & is_count(watch->good.engine_on, 1);
}

/* Seconds since the last call, one where the clock cannot be believed. */
static int32_t elapsed_s(mpc_watch *watch, int32_t second, int32_t *flags)
{
    int32_t elapsed = 1;
    if (watch->has_clock != 0) {
        const int64_t passed = (int64_t)second - (int64_t)watch->clock;
        const int32_t is_possible = ((passed >= 0) && (passed <= LONGEST_GAP_S)) ? 1 : 0;
        elapsed = (is_possible != 0) ? (int32_t)passed : 1;
        if ((is_possible == 0) || (passed == 0)) {
            *flags |= MPC_BAD_CLOCK;
        }
    }
    watch->clock = second;
    return elapsed;
}

/* SOC and coolant temperature that a second of the last command led to. */
static void predict(const mpc_watch *watch, const mpc_calibration *cal, mpc_real *soc,
                    mpc_real *t_cl_degc)
{
    const mpc_measured *const good = &watch->good;
    const mpc_real accepted_w = mpc_map_charge_limit_w(good->soc, cal->soc_max);
    const int32_t starts = ((watch->command_on != 0) && (good->engine_on == 0)) ? 1 : 0;
    const mpc_real start_g = (starts != 0) ? cal->start_fuel_g : REAL(0.0);
    const mpc_real cranking_w = (starts != 0) ? mpc_par.start_energy_j : REAL(0.0);
    const mpc_real aux_w = mpc_par.aux_power_w + cranking_w;
    mpc_real p_bat_w = (good->demand_w + aux_w) - watch->command_w;
    if ((p_bat_w < -accepted_w) && (good->demand_w < REAL(0.0))) {
        /* the brakes take what the battery cannot */
        p_bat_w = real_min(-accepted_w, aux_w - watch->command_w);
    }
    const mpc_real current_a = mpc_map_current_a(good->soc, p_bat_w);
    const mpc_real hot_g_per_s = cal->fuel_scale * mpc_map_fuel_g_per_s(watch->command_w);
    const mpc_real fuel_g = (mpc_map_cold_factor(good->t_cl_degc) * hot_g_per_s) + start_g;
    const mpc_real fuel_w = fuel_g * mpc_par.lhv_j_per_g;
    const mpc_real engine_w = heat_engine_w(fuel_w, watch->command_w);
    const mpc_real heat_w = ((watch->command_on != 0) ? engine_w : REAL(0.0))
                            - heat_cooling_w(good->t_cl_degc, good->speed_mps);
    *soc = real_clip(good->soc - (current_a / mpc_par.charge_c), REAL(0.0), REAL(1.0));
    *t_cl_degc = real_clip(good->t_cl_degc + (heat_w / mpc_par.heat_capacity_j_per_k),
                           mpc_par.can_coldest_degc, mpc_par.can_hottest_degc);
}

/* Use a value within reach of what is expected, else that; `since_s` is 0 if it was. */
static int32_t take(mpc_real *good, mpc_real value, mpc_real expected, mpc_real per_s,
                    int32_t *since_s)
{
    const int32_t reach_s = *since_s + 1;
    const mpc_real reach = per_s * (mpc_real)reach_s;
    const int32_t fine = within(value, expected - reach, expected + reach);
    *good = (fine != 0) ? value : expected;
    *since_s = (fine != 0) ? 0 : *since_s;
    return fine;
}

static int32_t later(int32_t since_s, int32_t passed_s)
{
    const int32_t sum_s = since_s + passed_s;
    return (sum_s < LONG_AGO_S) ? sum_s : LONG_AGO_S;
}

/* Seconds since the engine was started or stopped, with the last command if at all, and its power
 * in the last second. Nothing is known at first, nor of the power of an engine that runs without a
 * command. In the same second again the first command does not count. */
static void know_engine(mpc_watch *watch, int32_t was_on, int32_t is_first, int32_t passed)
{
    mpc_measured *const good = &watch->good;
    if (is_first != 0) {
        good->engine_for_s = LONG_AGO_S;
    } else if (good->engine_on == was_on) {
        good->engine_for_s = later(good->engine_for_s, passed);
    } else {
        good->engine_for_s = (passed > 0) ? passed : 1;
    }
    if (good->engine_on == 0) {
        good->p_eng_before_w = REAL(0.0);
    } else if ((was_on == 0) || (passed > 0)) {
        good->p_eng_before_w = (watch->command_on != 0) ? watch->command_w : mpc_par.engine_max_w;
    } else {
        /* as it was */
    }
}

int32_t mpc_check_measured(mpc_watch *watch, const mpc_calibration *cal, const mpc_in *in,
                           int32_t *elapsed)
{
    mpc_measured *const good = &watch->good;
    const int32_t was_on = good->engine_on;
    const int32_t is_first = (watch->has_clock == 0) ? 1 : 0;
    int32_t flags = 0;
    mpc_real soc = good->soc;
    mpc_real t_cl_degc = good->t_cl_degc;
    *elapsed = elapsed_s(watch, in->second, &flags);
    const int32_t passed = (is_first != 0) ? 0 : *elapsed;
    watch->has_clock = 1;
    watch->soc_since_s = later(watch->soc_since_s, passed);
    watch->t_cl_since_s = later(watch->t_cl_since_s, passed);
    predict(watch, cal, &soc, &t_cl_degc); /* always: it takes time */
    soc = (passed > 0) ? soc : good->soc;
    t_cl_degc = (passed > 0) ? t_cl_degc : good->t_cl_degc;
    /* a value out of range is beyond any reach */
    const mpc_real seen_soc = (within(in->soc, REAL(0.0), REAL(1.0)) != 0) ? in->soc : NO_VALUE;
    const mpc_real seen_degc =
        (within(in->t_cl_degc, mpc_par.can_coldest_degc, mpc_par.can_hottest_degc) != 0)
            ? in->t_cl_degc
            : NO_VALUE;
    int32_t fine = take(&good->soc, seen_soc, soc, mpc_par.can_soc_per_s, &watch->soc_since_s);
    fine &= take(&good->t_cl_degc, seen_degc, t_cl_degc, mpc_par.can_t_cl_k_per_s,
                 &watch->t_cl_since_s);
    if (mpc_check_second(in->demand_w, REAL(0.0)) != 0) {
        good->demand_w = in->demand_w;
    } else {
        fine = 0;
    }
    if (mpc_check_second(REAL(0.0), in->speed_mps) != 0) {
        good->speed_mps = in->speed_mps;
    } else {
        fine = 0;
    }
    if (is_count(in->engine_on, 1) != 0) {
        good->engine_on = in->engine_on;
    } else {
        good->engine_on = watch->command_on;
        fine = 0;
    }
#if MPC_LEARNING
    if (within(in->fuel_g, REAL(0.0), mpc_par.learned_most_g) != 0) {
        good->fuel_g = in->fuel_g;
    } else {
        good->fuel_g = REAL(-1.0); /* not known */
        fine = 0;
    }
#endif
    know_engine(watch, was_on, is_first, passed);
    return flags | ((fine != 0) ? 0 : MPC_BAD_MEASUREMENT);
}
