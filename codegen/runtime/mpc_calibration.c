/* Numbers that are tuned on the car: checked, and taken over as a whole or not at all. */
#include "mpc_calibration_orders.h"
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"

/* The first of so many that is out of its bounds, or none at all; else `wrong`. */
static int32_t unbounded(const mpc_real *value, int32_t count, int32_t wrong)
{
    int32_t first = wrong;
    for (int32_t i = count - 1; i >= 0; i--) {
        const mpc_real inside = real_clip(value[i], mpc_par.cal_least[i], mpc_par.cal_most[i]);
        first = (inside == value[i]) ? first : i;
    }
    return first;
}

/* Each entry is read once: it may be written meanwhile. The same work whether it is good or not. */
int32_t mpc_calibration_take(mpc_state *state)
{
    const volatile mpc_calibration *const page = &state->calibration;
    const mpc_calibration seen = MPC_CAL_VALUES(page);
    const mpc_real value[MPC_CAL_ENTRIES] = MPC_CAL_VALUES(&seen);
    const int32_t wrong = unbounded(value, MPC_CAL_ENTRIES, contradiction(value));
    const mpc_calibration *const good = (wrong < 0) ? &seen : &state->cal;
    state->cal = *good;
    return wrong;
}

/* The first numbers, by which the safety layer keeps the limits; what the others do, it undoes. */
int32_t mpc_calibration_check(const mpc_calibration *cal)
{
    const mpc_real value[MPC_CAL_OF_SAFETY] = {
        cal->soc_min,      cal->soc_max,    cal->t_cl_min_degc, cal->t_cl_max_degc,
        cal->ramp_w_per_s, cal->fuel_scale, cal->start_fuel_g};
    return (unbounded(value, MPC_CAL_OF_SAFETY, -1) < 0) ? 1 : 0;
}
