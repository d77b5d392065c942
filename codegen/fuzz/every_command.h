/* One second of the car under any command: the plant's equations written a second time, in double
 * precision, from the tables of mpc_par. */
#ifndef EVERY_COMMAND_H
#define EVERY_COMMAND_H

#include "mpc.h"

/* State of the car, and the road of the coming second. */
typedef struct {
    double soc;
    double t_cl_degc;
    double demand_w;
    double speed_mps;
    int engine_on;
    double p_eng_before_w;      /* power in the last second */
    int engine_for_s;           /* since it was started or stopped */
    const mpc_calibration *cal; /* limits and fuel: the car's own, or those in use */
} second_start;

/* Excess over the limits of battery power, SOC and coolant, in order of priority; 0 if kept. A start
 * has to keep them with the power that cranks the engine and without. */
typedef struct {
    double of[3];
} excess;

/* The car one second later; its road stays. SOC and coolant stay in what is possible at all. */
second_start second_later(const second_start *from, int engine_on, double p_eng_w);

/* Greatest power that the running engine may have. */
double greatest_w(const second_start *from);

/* What a command would exceed. Far beyond a limit, more is still counted as worse. */
excess excess_of(const second_start *from, int engine_on, double p_eng_w);

/* How much less some other command of a grid would exceed: the first limit at which one is better,
 * by more than `tolerance`, and not worse at any before. -1 if there is none. */
int avoidable(const second_start *from, const mpc_out *out, const double *tolerance);

/* Whether the engine is started or stopped although its shortest rest or run is not over and some
 * command that goes on stays inside all limits, by more than the margins of the safety layer. */
int cut_short(const second_start *from, const mpc_out *out);

#endif
