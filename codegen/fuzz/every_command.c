#include "every_command.h"

#include <math.h>

#include "mpc_constants.h"
#include "mpc_model.h"

#define POWERS 41 /* tried from least to most */
#define LIMITS 3

static double clip(double x, double low, double high) { return fmin(fmax(x, low), high); }

static double interpolated(const mpc_real *x, const mpc_real *y, int count, double at)
{
    int i = 1;
    while ((i < count - 1) && (at > (double)x[i])) {
        i++;
    }
    const double share = clip((at - (double)x[i - 1]) / ((double)x[i] - (double)x[i - 1]), 0, 1);
    return (double)y[i - 1] + share * ((double)y[i] - (double)y[i - 1]);
}

static double voltage_v(double soc)
{
    return interpolated(mpc_par.soc_grid, mpc_par.open_circuit_v, MPC_SOC_POINTS, soc);
}

static double resistance_ohm(double soc, int discharging)
{
    const mpc_real *table = discharging ? mpc_par.resistance_discharge_ohm
                                        : mpc_par.resistance_charge_ohm;
    return interpolated(mpc_par.soc_grid, table, MPC_SOC_POINTS, soc);
}

/* All that a battery can give, U^2 / (4 R): beyond, demand is not met. */
static double most_w(double soc)
{
    return voltage_v(soc) * voltage_v(soc) / (4 * resistance_ohm(soc, 1));
}

/* The smaller root of R I^2 - U I + P = 0. */
static double current_a(double soc, double power_w)
{
    const double voltage = voltage_v(soc);
    const double resistance = resistance_ohm(soc, power_w >= 0);
    const double used_w = fmin(power_w, most_w(soc));
    return 2 * used_w / (voltage + sqrt(fmax(voltage * voltage - 4 * resistance * used_w, 0)));
}

/* Power of the battery: the brakes take braking power beyond what just fills it to its limit. */
static double battery_w(const second_start *from, double p_eng_w, double cranking_w)
{
    const double room_a = fmax((double)from->cal->soc_max - from->soc, 0)
                          * (double)mpc_par.charge_c;
    const double filling_w = room_a
                             * (voltage_v(from->soc) + resistance_ohm(from->soc, 0) * room_a);
    const double accepted_w = fmin(filling_w, (double)mpc_par.battery_charge_max_w);
    const double asked_w = from->demand_w + (double)mpc_par.aux_power_w + cranking_w - p_eng_w;
    const double brakes_w = clip(-accepted_w - asked_w, 0, fmax(-from->demand_w, 0));
    return asked_w + brakes_w;
}

static double coolant_later_degc(const second_start *from, int engine_on, double p_eng_w)
{
    const double t = from->t_cl_degc;
    const double place = p_eng_w / (double)mpc_par.fuel_step_w;
    int i = (int)place;
    i = (i < MPC_FUEL_POINTS - 1) ? i : MPC_FUEL_POINTS - 2;
    const double left = (double)mpc_par.fuel_g_per_s[i];
    const double cold = fmax((double)mpc_par.cold_hot_degc - t, 0) / (double)mpc_par.cold_span_k;
    const double alpha = 1 + (double)mpc_par.cold_k * pow(cold, (double)mpc_par.cold_exponent);
    double fuel = left + ((double)mpc_par.fuel_g_per_s[i + 1] - left) * (place - i);
    fuel *= alpha * (double)from->cal->fuel_scale;
    fuel += from->engine_on ? 0 : (double)from->cal->start_fuel_g;
    const double lost_w = engine_on ? fuel * (double)mpc_par.lhv_j_per_g - p_eng_w : 0;
    const double above_k = t - (double)mpc_par.t_amb_degc;
    const double ua = (double)mpc_par.ua0_w_per_k
                      + (double)mpc_par.ua1_w_per_k_per_mps * from->speed_mps;
    const double open =
        clip((t - (double)mpc_par.thermostat_open_degc) / (double)mpc_par.thermostat_span_k, 0, 1);
    const double from_degc = (double)mpc_par.cabin_heat_from_degc;
    const double fade =
        clip((t - from_degc) / ((double)mpc_par.cabin_heat_full_degc - from_degc), 0, 1);
    const double heat_w = (1 - (double)mpc_par.exhaust_share) * lost_w
                          - (ua + open * (double)mpc_par.radiator_w_per_k) * above_k
                          - fade * (double)mpc_par.cabin_heat_w;
    return t + heat_w / (double)mpc_par.heat_capacity_j_per_k;
}

static double soc_later(const second_start *from, double p_bat_w)
{
    return from->soc - current_a(from->soc, p_bat_w) / (double)mpc_par.charge_c;
}

static double cranking_w(const second_start *from, int engine_on)
{
    return (engine_on && !from->engine_on) ? (double)mpc_par.start_energy_j : 0;
}

second_start second_later(const second_start *from, int engine_on, double p_eng_w)
{
    second_start later = *from;
    const double p_bat_w = battery_w(from, p_eng_w, cranking_w(from, engine_on));
    later.soc = clip(soc_later(from, p_bat_w), 0, 1);
    later.t_cl_degc = clip(coolant_later_degc(from, engine_on, p_eng_w),
                           (double)mpc_par.can_coldest_degc, (double)mpc_par.can_hottest_degc);
    later.engine_on = engine_on;
    later.p_eng_before_w = p_eng_w;
    later.engine_for_s = (engine_on == from->engine_on) ? from->engine_for_s + 1 : 1;
    return later;
}

static double beyond(double value, double low, double high)
{
    return fmax(fmax(low - value, value - high), 0);
}

static excess excess_at(const second_start *from, int engine_on, double p_eng_w, double p_bat_w)
{
    const excess found = {{
        beyond(p_bat_w, -(double)mpc_par.battery_charge_max_w,
               fmin((double)mpc_par.battery_discharge_max_w, most_w(from->soc))),
        beyond(soc_later(from, p_bat_w), (double)from->cal->soc_min, (double)from->cal->soc_max),
        beyond(coolant_later_degc(from, engine_on, p_eng_w), (double)from->cal->t_cl_min_degc,
               (double)from->cal->t_cl_max_degc),
    }};
    return found;
}

/* Too fast for an engine that is off: no other limit counts. */
static int is_forbidden(const second_start *from, int engine_on)
{
    return !engine_on && from->speed_mps > (double)mpc_par.electric_max_mps;
}

excess excess_of(const second_start *from, int engine_on, double p_eng_w)
{
    const double cranked_w = battery_w(from, p_eng_w, cranking_w(from, engine_on));
    excess found = excess_at(from, engine_on, p_eng_w, battery_w(from, p_eng_w, 0));
    const excess cranked = excess_at(from, engine_on, p_eng_w, cranked_w);
    for (int i = 0; i < LIMITS; i++) {
        found.of[i] = fmax(found.of[i], cranked.of[i]);
    }
    found.of[0] = is_forbidden(from, engine_on) ? 1e30 : found.of[0];
    return found;
}

double greatest_w(const second_start *from)
{
    const double before_w = from->engine_on ? from->p_eng_before_w : 0;
    const double ramped_w = before_w + (double)from->cal->ramp_w_per_s - (double)POWER_MARGIN_W;
    return clip(ramped_w, (double)mpc_par.engine_min_w, (double)mpc_par.engine_max_w);
}

static int better_at(const excess *other, const excess *found, const double *tolerance)
{
    for (int i = 0; i < LIMITS; i++) {
        if (other->of[i] < found->of[i] - tolerance[i]) {
            return i;
        }
        if (other->of[i] > found->of[i]) {
            return -1;
        }
    }
    return -1;
}

int avoidable(const second_start *from, const mpc_out *out, const double *tolerance)
{
    static const double aside_w[] = {-1000, -100, -10, -1, -0.1, 0.1, 1, 10, 100, 1000};
    const int neighbours = (int)(sizeof aside_w / sizeof aside_w[0]);
    const double least_w = (double)mpc_par.engine_min_w;
    const double top_w = greatest_w(from);
    const excess found = excess_of(from, out->engine_on, (double)out->p_eng_w);
    const excess off = excess_of(from, 0, 0);
    int worst = better_at(&off, &found, tolerance);
    for (int i = 0; i < POWERS + neighbours; i++) {
        const double power_w =
            (i < POWERS) ? least_w + (top_w - least_w) * i / (POWERS - 1)
                         : clip((double)out->p_eng_w + aside_w[i - POWERS], least_w, top_w);
        const excess other = excess_of(from, 1, power_w);
        const int at = better_at(&other, &found, tolerance);
        worst = (at >= 0) ? at : worst;
    }
    return worst;
}

/* Whether a command stays inside all limits by twice the margins of the safety layer. */
static int is_well_inside(const second_start *from, int engine_on, double p_eng_w)
{
    const double t = coolant_later_degc(from, engine_on, p_eng_w);
    int inside = t >= (double)from->cal->t_cl_min_degc + 2 * (double)T_CL_MARGIN_K
                 && t <= (double)from->cal->t_cl_max_degc - 2 * (double)T_CL_MARGIN_K;
    for (int cranked = 0; cranked < 2; cranked++) {
        const double p_bat_w = battery_w(from, p_eng_w, cranked ? cranking_w(from, engine_on) : 0);
        const double soc = soc_later(from, p_bat_w);
        inside &= p_bat_w >= -(double)mpc_par.battery_charge_max_w + 2 * (double)POWER_MARGIN_W
                  && p_bat_w <= (double)mpc_par.battery_discharge_max_w - 2 * (double)POWER_MARGIN_W
                  && soc >= (double)from->cal->soc_min + 2 * (double)SOC_MARGIN
                  && soc <= (double)from->cal->soc_max - 2 * (double)SOC_MARGIN;
    }
    return inside;
}

int cut_short(const second_start *from, const mpc_out *out)
{
    const double least_w = (double)mpc_par.engine_min_w;
    const int32_t shortest_s = from->engine_on ? mpc_par.min_on_s : mpc_par.min_off_s;
    if (from->engine_for_s >= shortest_s || out->engine_on == from->engine_on) {
        return 0;
    }
    int could_go_on = 0;
    if (is_forbidden(from, from->engine_on)) {
        return 0;
    }
    for (int i = 0; i < POWERS; i++) {
        const double power_w = least_w + (greatest_w(from) - least_w) * i / (POWERS - 1);
        could_go_on |= is_well_inside(from, from->engine_on, from->engine_on ? power_w : 0);
    }
    return could_go_on;
}
