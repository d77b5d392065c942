/* A trip on this machine: take it as a forecast, depart, decide second by second, print commands.
 *
 *     make example
 *     ./example                          a built-in trip of a minute
 *     ./example TRIP.csv > commands.csv
 *
 * TRIP.csv has a heading and then one line per second of the trip:
 * demand_w,speed_mps,soc,t_cl_degc. Demand and speed are both the forecast and the true trip. SOC
 * and coolant temperature are those measured at the start of the second; this program does not
 * simulate a car.
 */
#include <stdio.h>

#include "mpc_forecast.h"

#define LONGEST_S 7200
#define LINE_LENGTH 256

static mpc_real demand_w[LONGEST_S];
static mpc_real speed_mps[LONGEST_S];
static mpc_real soc[LONGEST_S];
static mpc_real t_cl_degc[LONGEST_S];

static mpc_state state;
static mpc_forecast forecast;

/* Launch, a hill, braking to a stop: from speeds as in a navigation system. */
static int32_t built_in_trip(void)
{
    static const int32_t steps = 60;
    mpc_real speed = (mpc_real)0.0;
    for (int32_t k = 0; k < steps; k++) {
        mpc_real accel = (mpc_real)0.0;
        if (k < 15) {
            accel = (mpc_real)1.0;
        } else if (k >= 50) {
            accel = (mpc_real)-1.5;
        } else {
            /* steady */
        }
        const mpc_real grade = ((k >= 25) && (k < 40)) ? (mpc_real)0.03 : (mpc_real)0.0;
        const mpc_real mean = speed + ((mpc_real)0.5 * accel);
        demand_w[k] = mpc_demand_w(mean, accel, grade);
        speed_mps[k] = mean;
        soc[k] = (mpc_real)0.6;
        t_cl_degc[k] = (mpc_real)50.0;
        speed += accel;
    }
    return steps;
}

/* Returns the number of seconds, or -1. */
static int32_t read_trip(const char *name)
{
    char line[LINE_LENGTH];
    int32_t steps = -1;
    FILE *const file = fopen(name, "r");
    if (file == NULL) {
        (void)fprintf(stderr, "%s: cannot be read\n", name);
    } else {
        int32_t fine = (fgets(line, LINE_LENGTH, file) != NULL) ? 1 : 0; /* the heading */
        steps = 0;
        while ((fine != 0) && (fgets(line, LINE_LENGTH, file) != NULL)) {
            double cell[4];
            const int found =
                sscanf(line, "%lf,%lf,%lf,%lf", &cell[0], &cell[1], &cell[2], &cell[3]);
            fine = ((found == 4) && (steps < LONGEST_S)) ? 1 : 0;
            if (fine != 0) {
                demand_w[steps] = (mpc_real)cell[0];
                speed_mps[steps] = (mpc_real)cell[1];
                soc[steps] = (mpc_real)cell[2];
                t_cl_degc[steps] = (mpc_real)cell[3];
                steps++;
            }
        }
        if (fine == 0) {
            (void)fprintf(stderr,
                          "%s: line %d is not demand_w,speed_mps,soc,t_cl_degc, or beyond %d s\n",
                          name, (int)steps + 2, LONGEST_S);
            steps = -1;
        }
        (void)fclose(file);
    }
    return steps;
}

/* The engine is taken to obey: it ran in the last second if it was told to. */
static void measure(int32_t step, int32_t engine_on, mpc_in *in)
{
    in->engine_on = engine_on;
    in->soc = soc[step];
    in->t_cl_degc = t_cl_degc[step];
    in->demand_w = demand_w[step];
    in->speed_mps = speed_mps[step];
#if MPC_LEARNING
    in->fuel_g = (mpc_real)0.0; /* no such sensor here: nothing is learned */
#endif
}

static void drive(int32_t steps)
{
    mpc_in in;
    mpc_out out;
    int32_t engine_on = 0;
    mpc_init(&state);
    (void)mpc_in_from_forecast(&forecast, 0, &in);
    measure(0, engine_on, &in);
    while (mpc_depart(&state, &in) > 0) {
        /* one slice takes no longer than a step */
    }
    (void)printf("time_s,engine_on,p_eng_w,rung,flags\n");
    for (int32_t step = 0; step < steps; step++) {
        (void)mpc_in_from_forecast(&forecast, step, &in);
        measure(step, engine_on, &in);
        (void)mpc_step(&state, &in, &out);
        engine_on = out.engine_on;
        (void)printf("%d,%d,%.3f,%d,%d\n", (int)step, (int)out.engine_on, (double)out.p_eng_w,
                     (int)out.rung, (int)out.flags);
    }
}

int main(int argc, char **argv)
{
    const int32_t steps = (argc > 1) ? read_trip(argv[1]) : built_in_trip();
    int result = 1;
    if (steps >= 0) {
        const mpc_road trip = {demand_w, speed_mps, steps};
        if (mpc_forecast_start(&forecast, &trip) == 0) {
            drive(steps);
            result = 0;
        } else {
            (void)fprintf(stderr, "the trip is empty or has a value out of range\n");
        }
    }
    return result;
}
