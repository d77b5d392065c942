/* Coolant over one stage with a thermostat that opens meanwhile: exact, and its derivatives.
 *
 * With u = T - T_open, q the heat and s the radiator's slope, C du/dt = q - s max(u, 0): a straight
 * line below u = 0, an exponential above; u = 0 is crossed at most once.
 */
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"

/* The exponential, from u on. */
static thermostat_end open_for(real_t duration_s, real_t u, real_t heat_w)
{
    const real_t slope = mpc_par.thermostat_w_per_k;
    const real_t aim = heat_w / slope;
    const real_t decay = REAL_EXP(-duration_s * slope / mpc_par.heat_capacity_j_per_k);
    const thermostat_end end = {aim + ((u - aim) * decay), (REAL(1.0) - decay) / slope, decay};
    return end;
}

/* The straight line, from u on. */
static thermostat_end closed_for(real_t duration_s, real_t u, real_t heat_w)
{
    const real_t rate = duration_s / mpc_par.heat_capacity_j_per_k;
    const thermostat_end end = {u + (rate * heat_w), rate, REAL(1.0)};
    return end;
}

/* K above the thermostat's opening at the end of a stage, with its derivatives. */
thermostat_end thermostat_step(real_t duration_s, real_t start_k, real_t heat_w)
{
    const real_t capacity = mpc_par.heat_capacity_j_per_k;
    const real_t slope = mpc_par.thermostat_w_per_k;
    thermostat_end end;
    if (start_k < REAL(0.0)) {
        end = closed_for(duration_s, start_k, heat_w);
        if (end.over_k > REAL(0.0)) { /* it opens on the way */
            const real_t closed_s = -start_k * capacity / heat_w;
            end = open_for(duration_s - closed_s, REAL(0.0), heat_w);
            end.per_heat += end.per_start * closed_s / capacity;
        }
    } else {
        end = open_for(duration_s, start_k, heat_w);
        if (end.over_k < REAL(0.0)) { /* it closes on the way */
            const real_t aim = heat_w / slope;
            const real_t open_s = capacity / slope * REAL_LOG((start_k - aim) / -aim);
            end = closed_for(duration_s - open_s, REAL(0.0), heat_w);
            end.per_heat += (REAL(1.0) + (aim / (start_k - aim))) / slope;
            end.per_start = -aim / (start_k - aim);
        }
    }
    return end;
}
