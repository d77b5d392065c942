/* Checks of inputs: finite and physically possible. */
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"

#define LARGEST_POWER_W REAL(1.0e6)
#define LARGEST_SPEED_MPS REAL(150.0)
#define COLDEST_DEGC REAL(-60.0)
#define HOTTEST_DEGC REAL(150.0)
#define LONGEST_STAGE_S REAL(1.0e5)

/* False for NaN, whatever the bounds. */
static int32_t within(mpc_real x, mpc_real low, mpc_real high)
{
    return ((x >= low) && (x <= high)) ? 1 : 0;
}

static int32_t take(mpc_real *good, mpc_real value, mpc_real low, mpc_real high)
{
    const int32_t fine = within(value, low, high);
    if (fine != 0) {
        *good = value;
    }
    return fine;
}

/* Use every good measured value; the others keep the last good one. */
int32_t mpc_check_measured(mpc_measured *good, const mpc_in *in)
{
    int32_t fine = take(&good->soc, in->soc, REAL(0.0), REAL(1.0));
    fine &= take(&good->t_cl_degc, in->t_cl_degc, COLDEST_DEGC, HOTTEST_DEGC);
    fine &= take(&good->demand_w, in->demand_w, -LARGEST_POWER_W, LARGEST_POWER_W);
    fine &= take(&good->speed_mps, in->speed_mps, REAL(0.0), LARGEST_SPEED_MPS);
    return fine;
}

/* Check of one second of a trip. */
int32_t mpc_check_second(mpc_real demand_w, mpc_real speed_mps)
{
    return within(demand_w, -LARGEST_POWER_W, LARGEST_POWER_W)
           & within(speed_mps, REAL(0.0), LARGEST_SPEED_MPS);
}

int32_t mpc_check_preview(const mpc_in *in)
{
    int32_t fine = ((in->short_count >= 1) && (in->short_count <= MPC_SHORT)) ? 1 : 0;
    for (int32_t k = 0; k < MPC_SHORT; k++) {
        fine &= mpc_check_second(in->short_demand_w[k], in->short_speed_mps[k]);
    }
    for (int32_t k = 0; k < MPC_LONG; k++) {
        fine &= within(in->long_duration_s[k], REAL(0.0), LONGEST_STAGE_S);
        fine &= mpc_check_second(in->long_net_w[k], in->long_speed_mps[k]);
        fine &= within(in->long_internal_off_w[k], -LARGEST_POWER_W, LARGEST_POWER_W);
    }
    return fine;
}
