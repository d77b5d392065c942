#include "road.h"

#include <math.h>

#include "mpc_model.h"

#define LONGEST_S 900

uint32_t bits(source *from)
{
    uint32_t value = 0;
    for (int i = 0; i < 4; i++) {
        value = (value << 8) | below(from, 256);
    }
    return value;
}

uint32_t below(source *from, uint32_t count)
{
    uint32_t value = 0;
    for (int i = 0; i < ((count > 256) ? 2 : 1); i++) {
        value *= 256;
        if (from->left > 0) {
            value += *from->at;
            from->at++;
            from->left--;
        }
    }
    return value % count;
}

double between(source *from, double low, double high)
{
    return low + (high - low) * below(from, 65536) / 65535;
}

mpc_real hostile(source *from)
{
    const double values[] = {(double)NAN,
                             (double)INFINITY,
                             -(double)INFINITY,
                             1e38,
                             -1e38,
                             1e9,
                             1e6,
                             -1e6,
                             1e5,
                             -1e5,
                             -1,
                             1e-30,
                             1e-40,
                             0,
                             -0.0,
                             1,
                             0.4,
                             0.8,
                             90,
                             130,
                             -60,
                             1.00001};
    return (mpc_real)values[below(from, sizeof values / sizeof values[0])];
}

/* Spells of constant or ramped power at some speed; in the wildest style at the bounds of what is
 * believed of a car at all. */
mpc_road new_road(source *from)
{
    static mpc_real demand_w[LONGEST_S];
    static mpc_real speed_mps[LONGEST_S];
    const uint32_t style = below(from, 8);
    const uint32_t lengths[] = {1, 2, MPC_SHORT, MPC_SHORT + 1, 100, 300, 600, LONGEST_S};
    const uint32_t steps = lengths[below(from, 8)];
    const double most_w =
        (double)((style < 6) ? mpc_par.battery_discharge_max_w : mpc_par.can_demand_max_w);
    const double least_w = (style < 6) ? -0.5 * most_w : (double)mpc_par.can_demand_min_w;
    const double typical = (style < 4) ? 0.4 : 1;
    uint64_t random = bits(from);
    uint32_t until = 0;
    double level_w = 0;
    double slope = 0;
    double speed = 0;
    for (uint32_t k = 0; k < steps; k++) {
        if (k == until) {
            random = random * 6364136223846793005u + 1442695040888963407u;
            until = k + 1 + (uint32_t)(random >> 59);
            level_w = least_w + (most_w - least_w) * (double)((random >> 40) & 1023) / 1023;
            level_w *= ((random >> 32) & 1) ? typical : typical / 4;
            slope = ((random >> 50) & 1) ? 0 : level_w * (double)((random >> 51) & 15) / -100;
            speed = (double)((random >> 24) & 255) / 255
                    * ((style < 6) ? 40 : 0.999 * (double)mpc_par.can_speed_max_mps);
        }
        level_w = fmin(fmax(level_w + slope, least_w), most_w);
        demand_w[k] = (mpc_real)level_w;
        speed_mps[k] = (mpc_real)speed;
    }
    const mpc_road road = {demand_w, speed_mps, (int32_t)steps};
    return road;
}
