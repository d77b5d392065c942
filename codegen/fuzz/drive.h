/* A simulated car on a trip, with forecast, clock and sensors. */
#ifndef DRIVE_H
#define DRIVE_H

#include "bytes.h"
#include "every_command.h"
#include "mpc_forecast.h"

#define LONGEST_S 900

typedef struct {
    mpc_real demand_w[LONGEST_S];
    mpc_real speed_mps[LONGEST_S];
    mpc_road road;
    mpc_forecast forecast;
    second_start car;
    int32_t is_wild; /* the road demands more than engine and battery give */
    int32_t place;   /* seconds of the trip driven */
    int32_t clock_s; /* its clock is ahead by */
} drive;

/* A new trip for the same car: what it can drive, in two styles of eight the wildest that is
 * believed of it at all. Its clock starts anew. */
void take_road(drive *of, source *from);

/* SOC and coolant anywhere, often at a limit; engine off. */
void place_car(drive *of, source *from);

/* A calibration tool: writes the car's own page where another was refused. */
void restore(mpc_state *state, const mpc_out *out);

/* All inputs of the coming second; there must be one: see has_arrived. */
void measure(drive *of, mpc_in *in);

/* Some seconds with one command; to arrival at most. */
void move(drive *of, const mpc_out *out, int32_t seconds);

int has_arrived(const drive *of);

#endif
