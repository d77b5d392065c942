#include "drive.h"

#include <math.h>

#include "mpc_model.h"

/* Spells of constant or ramped power at some speed. */
void take_road(drive *of, source *from)
{
    const uint32_t style = below(from, 8);
    const uint32_t lengths[] = {1, 2, MPC_SHORT, MPC_SHORT + 1, 100, 300, 600, LONGEST_S};
    const uint32_t steps = lengths[below(from, 8)];
    const double most_w =
        (double)((style < 6) ? mpc_par.battery_discharge_max_w : mpc_par.can_demand_max_w);
    const double least_w = (style < 6) ? -0.5 * most_w : (double)mpc_par.can_demand_min_w;
    const double fastest = (style < 6) ? 40 : 0.999 * (double)mpc_par.can_speed_max_mps;
    const double typical = (style < 4) ? 0.4 : 1;
    uint64_t random = bits(from);
    uint32_t until = 0;
    double level_w = 0;
    double slope_w = 0;
    double speed = 0;
    for (uint32_t k = 0; k < steps; k++) {
        if (k == until) {
            random = random * 6364136223846793005u + 1442695040888963407u;
            until = k + 1 + (uint32_t)(random >> 59);
            level_w = least_w + (most_w - least_w) * (double)((random >> 40) & 1023) / 1023;
            level_w *= ((random >> 32) & 1) ? typical : typical / 4;
            slope_w = ((random >> 50) & 1) ? 0 : level_w * (double)((random >> 51) & 15) / -100;
            speed = fastest * (double)((random >> 24) & 255) / 255;
        }
        level_w = fmin(fmax(level_w + slope_w, least_w), most_w);
        of->demand_w[k] = (mpc_real)level_w;
        of->speed_mps[k] = (mpc_real)speed;
    }
    of->road.demand_w = of->demand_w;
    of->road.speed_mps = of->speed_mps;
    of->road.steps = (int32_t)steps;
    (void)mpc_forecast_start(&of->forecast, &of->road);
    of->is_wild = (style < 6) ? 0 : 1;
    of->car.cal = &mpc_par.calibration;
    of->place = 0;
    of->clock_s = 0;
}

void place_car(drive *of, source *from)
{
    const double limits[] = {0, (double)mpc_par.calibration.soc_min,
                             (double)mpc_par.calibration.soc_max, 1};
    const double warm[] = {(double)mpc_par.calibration.t_cl_min_degc,
                           (double)mpc_par.calibration.t_cl_max_degc};
    const double aside = between(from, -1e-3, 1e-3);
    const double soc = below(from, 2) ? between(from, 0, 1) : limits[below(from, 4)] + aside;
    of->car.soc = fmin(fmax(soc, 0), 1);
    of->car.t_cl_degc = below(from, 2) ? between(from, -60, 130)
                                       : warm[below(from, 2)] + 1e3 * aside;
    of->car.engine_on = 0;
    of->car.engine_for_s = LONGEST_S;
}

void restore(mpc_state *state, const mpc_out *out)
{
    if (out->flags & MPC_BAD_CALIBRATION) {
        state->calibration = mpc_par.calibration;
    }
}

void measure(drive *of, mpc_in *in)
{
    (void)mpc_in_from_forecast(&of->forecast, of->place, in);
    in->soc = (mpc_real)of->car.soc;
    in->t_cl_degc = (mpc_real)of->car.t_cl_degc;
    in->demand_w = of->demand_w[of->place];
    in->speed_mps = of->speed_mps[of->place];
    in->engine_on = of->car.engine_on;
    in->second = (int32_t)((uint32_t)of->place + (uint32_t)of->clock_s);
}

void move(drive *of, const mpc_out *out, int32_t seconds)
{
    for (int32_t k = 0; k < seconds && !has_arrived(of); k++) {
        of->car.demand_w = (double)of->demand_w[of->place];
        of->car.speed_mps = (double)of->speed_mps[of->place];
        of->car = second_later(&of->car, out->engine_on, (double)out->p_eng_w);
        of->place++;
    }
}

int has_arrived(const drive *of) { return of->place >= of->road.steps; }
