/* The long horizon's statistics from a forecast of the trip: public interface, beside mpc.h.
 *
 *     before the trip: mpc_forecast_start(&forecast, &trip);
 *     every second:    mpc_in_from_forecast(&forecast, step, &in);
 *                      fill in soc, t_cl_degc, demand_w, speed_mps, engine_on;
 *                      mpc_step(&state, &in, &out)
 *
 * `step` counts the seconds since departure. The trip's arrays belong to the caller, may lie in
 * flash and must not change until arrival. Only a start reads the whole trip; after it each second
 * costs the same few instructions for trips of any length.
 */
#ifndef MPC_FORECAST_H
#define MPC_FORECAST_H

#include <stdint.h>

#include "mpc.h"

#ifdef __cplusplus
extern "C" {
#endif

#define MPC_LONGEST_TRIP_S 100000

/* The trip ahead, second by second. */
typedef struct {
    const mpc_real *demand_w;  /* power demand of each second, negative when braking */
    const mpc_real *speed_mps; /* mean speed of each second */
    int32_t steps;             /* seconds to arrival */
} mpc_road;

/* A sum and its rounding error: twice the digits of one number. */
typedef struct {
    mpc_real sum;
    mpc_real lost;
} mpc_sum;

/* The rest of one demand class of one block. */
typedef struct {
    int32_t seconds;
    int32_t rises; /* of the demand into it or past it */
    int32_t musts; /* of its seconds those in which the engine must run */
    mpc_sum net_w;
    mpc_sum speed_mps;
    mpc_sum internal_off_w;
    mpc_sum free_net_w; /* of the seconds in which the engine may be off */
    mpc_sum free_internal_off_w;
} mpc_class_sums;

/* Energy, J, that the battery falls and rises. */
typedef struct {
    mpc_real fall_j;
    mpc_real rise_j;
} mpc_swing;

/* The room for braking is kept at so many places, as many seconds apart or more in a trip of over two
 * hours; in between it is found again every second. */
#define MPC_ROOMS 225
#define MPC_ROOM_S 32

/* Stretches of the trip in which the use of room in the battery is one number, and the seconds of each,
 * or more in a trip of over two hours. */
#define MPC_STRETCHES 900
#define MPC_STRETCH_S 8

/* Memory of one forecast. Its contents are private; the caller needs only its size. */
typedef struct {
    uint32_t magic; /* tells a started forecast from any other memory, as does magic_end */
    mpc_road trip;
    int32_t place_s; /* length of each of as many fixed places as there are blocks */
    int32_t covered; /* seconds of the trip in them */
    int32_t next;    /* first second that is in the sums, where the first block begins */
    mpc_class_sums ahead[MPC_LONG];
    mpc_swing swing[MPC_BLOCKS];   /* kept from the SOC limits at the end of each place */
    mpc_real room_j[MPC_ROOMS];    /* for the braking from each of them on */
    mpc_real use_j[MPC_STRETCHES]; /* of room in the battery, in each stretch */
    uint32_t magic_end;
} mpc_forecast;

/* Take a forecast of the whole trip, from departure to arrival; its length sets the places.
 *
 * Returns 0, or -1 if the trip has no second or more than MPC_LONGEST_TRIP_S, or a value that
 * mpc_step would refuse. Then the long horizon stays empty. It may be called again under way, with
 * another forecast of the whole trip; its values of the past are not used.
 */
int32_t mpc_forecast_start(mpc_forecast *forecast, const mpc_road *trip);

/* Fill in the clock and the preview of the second `step`, the forecast serving as the short preview
 * too.
 *
 * Returns 0, or -1 if nothing is ahead or `forecast` has not been started, or was corrupted:
 * short_count is then 0, and mpc_step flags MPC_BAD_PREVIEW.
 */
int32_t mpc_in_from_forecast(mpc_forecast *forecast, int32_t step, mpc_in *in);

/* The same with a better short preview: `seen`, whose first second is the coming one. At most
 * MPC_SHORT values of its arrays are read. seen->steps above MPC_SHORT means that arrival is beyond
 * it; up to MPC_SHORT, that the trip ends there, whatever the length of the forecast.
 *
 * `beyond` is the first second of the forecast that `seen` does not show: that of the place on the
 * route where the car will be MPC_SHORT seconds from now, which does not wait for the clock. Let it
 * rise by no more than 2 a second, and by 1 while the car stands: a faster one looks like another
 * route, one that does not move like an old message. By the clock it is step + MPC_SHORT.
 */
int32_t mpc_in_from_preview(mpc_forecast *forecast, int32_t step, int32_t beyond,
                            const mpc_road *seen, mpc_in *in);

/* Power demand at the car's battery and engine, from speed, acceleration and grade (rise over run):
 *
 *     F = f (A + B v + C v^2) + m (k a + g grade / sqrt(1 + grade^2)),  A only while rolling
 *     P = F v / eta_drive when driving, F v eta_regen b(v) when braking
 *
 * with f = 1 + road_load_share_per_k max(24 degC - T_amb, 0), and b the share of the braking that is
 * regenerative, from 0 at regen_from_mps to 1 at regen_full_mps.
 *
 * The speed is the mean over a second, the acceleration the difference of speeds at its ends. */
mpc_real mpc_demand_w(mpc_real speed_mps, mpc_real accel_mps2, mpc_real grade);

/* sizeof(mpc_forecast), for a caller in another language. */
int32_t mpc_forecast_bytes(void);

#ifdef __cplusplus
}
#endif
#endif
