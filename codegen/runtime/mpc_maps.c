/* Maps of engine and battery: tables and closed forms. */
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"

/* Fuel of the hot engine on its optimal line, engine on, before the factor of the calibration:
 * linear between grid points. */
mpc_real mpc_map_fuel_g_per_s(mpc_real p_eng_w)
{
    const mpc_real place = real_clip(p_eng_w, REAL(0.0), mpc_par.engine_max_w)
                           / mpc_par.fuel_step_w;
    int32_t i = (int32_t)place;
    if (i > (MPC_FUEL_POINTS - 2)) {
        i = MPC_FUEL_POINTS - 2;
    }
    const mpc_real left = mpc_par.fuel_g_per_s[i];
    return left + ((mpc_par.fuel_g_per_s[i + 1] - left) * (place - (mpc_real)i));
}

/* alpha(T) = 1 + k ((T_hot - T) / span)^e below T_hot, else 1 */
mpc_real mpc_map_cold_factor(mpc_real t_cl_degc)
{
    const mpc_real below = real_max(mpc_par.cold_hot_degc - t_cl_degc, REAL(0.0));
    return REAL(1.0)
           + (mpc_par.cold_k * REAL_POW(below / mpc_par.cold_span_k, mpc_par.cold_exponent));
}

static mpc_real at_soc(const mpc_real *table, mpc_real soc)
{
    mpc_real value = table[0];
    for (int32_t i = 1; i < MPC_SOC_POINTS; i++) {
        const mpc_real left = mpc_par.soc_grid[i - 1];
        const mpc_real share = (soc - left) / (mpc_par.soc_grid[i] - left);
        const mpc_real inside = real_clip(share, REAL(0.0), REAL(1.0));
        value += (table[i] - table[i - 1]) * inside;
    }
    return value;
}

/* Terminal power, discharge positive, that leads from one SOC to another in a second: I (U - R I),
 * in discharge no more than the battery can give. */
mpc_real mpc_map_power_to_reach_w(mpc_real soc, mpc_real soc_end)
{
    const mpc_real voltage = at_soc(mpc_par.open_circuit_v, soc);
    const mpc_real wanted = (soc - soc_end) * mpc_par.charge_c;
    const mpc_real resistance = at_soc((wanted >= REAL(0.0)) ? mpc_par.resistance_discharge_ohm
                                                             : mpc_par.resistance_charge_ohm,
                                       soc);
    /* beyond this current, power falls */
    const mpc_real current = real_min(wanted, voltage / (REAL(2.0) * resistance));
    return current * (voltage - (resistance * current));
}

/* Energy of a full battery at the open-circuit voltage of an SOC. */
mpc_real mpc_map_energy_j(mpc_real soc)
{
    return at_soc(mpc_par.open_circuit_v, soc) * mpc_par.charge_c;
}

/* Most power that the battery accepts: its limit, or what just fills it to soc_max in a second. */
mpc_real mpc_map_charge_limit_w(mpc_real soc, mpc_real soc_max)
{
    const mpc_real filling_w = -mpc_map_power_to_reach_w(soc, soc_max);
    return real_min(mpc_par.battery_charge_max_w, real_max(filling_w, REAL(0.0)));
}

/* I = [U - sqrt(U^2 - 4 R P)] / (2 R), written so that no digits are lost at small P; beyond the
 * most the battery can give it stays at U / (2 R). */
mpc_real mpc_map_current_a(mpc_real soc, mpc_real power_w)
{
    const mpc_real voltage = at_soc(mpc_par.open_circuit_v, soc);
    const mpc_real resistance = at_soc((power_w >= REAL(0.0)) ? mpc_par.resistance_discharge_ohm
                                                              : mpc_par.resistance_charge_ohm,
                                       soc);
    const mpc_real root = (voltage * voltage) - (REAL(4.0) * resistance * power_w);
    const mpc_real most = (voltage * voltage) / (REAL(4.0) * resistance);
    return (REAL(2.0) * real_min(power_w, most)) / (voltage + REAL_SQRT(real_max(root, REAL(0.0))));
}

/* Internal power of the battery, l(P) = U (U - sqrt(U^2 - 4 R P)) / (2 R), at the plan's SOC.
 * Written as 2 U P / (U + sqrt(...)), which loses no digits at small P. */
mpc_real mpc_map_planned_internal_w(mpc_real power_w)
{
    const mpc_real power = real_min(power_w, mpc_par.battery_discharge_max_w);
    const mpc_real voltage = mpc_par.plan_voltage_v;
    const mpc_real resistance = (power >= REAL(0.0)) ? mpc_par.plan_resistance_discharge_ohm
                                                     : mpc_par.plan_resistance_charge_ohm;
    const mpc_real root = (voltage * voltage) - (REAL(4.0) * resistance * power);
    return (REAL(2.0) * voltage * power) / (voltage + REAL_SQRT(real_max(root, REAL(0.0))));
}

mpc_real mpc_pwa_alpha(mpc_real t_cl_degc)
{
    mpc_real most = (mpc_par.alpha_slope[0] * t_cl_degc) + mpc_par.alpha_intercept[0];
    for (int32_t i = 1; i < MPC_ALPHA_PIECES; i++) {
        most = real_max(most, (mpc_par.alpha_slope[i] * t_cl_degc) + mpc_par.alpha_intercept[i]);
    }
    return most;
}

mpc_real mpc_pwa_alpha_slope(mpc_real t_cl_degc)
{
    mpc_real slope = mpc_par.alpha_slope[0];
    for (int32_t i = 1; i < MPC_ALPHA_PIECES; i++) {
        slope = (t_cl_degc >= mpc_par.alpha_break[i]) ? mpc_par.alpha_slope[i] : slope;
    }
    return slope;
}

mpc_real mpc_pwa_battery(mpc_real power_w)
{
    mpc_real most = (mpc_par.battery_slope[0] * power_w) + mpc_par.battery_intercept[0];
    for (int32_t j = 1; j < MPC_BATTERY_PIECES; j++) {
        most = real_max(most, (mpc_par.battery_slope[j] * power_w) + mpc_par.battery_intercept[j]);
    }
    return most;
}
