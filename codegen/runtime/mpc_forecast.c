/* From a forecast of the trip to the statistics of its blocks: running sums for each block and
 * demand class, over the trip beyond the short horizon.
 *
 * A start adds up the whole trip; each second then subtracts the one that the short horizon has
 * reached, and hands over the first second of a block to the block before it where their bound moves
 * on. Rounding errors are carried along (Knuth's TwoSum), so that a sum of thousands of seconds that
 * shrinks to a single one keeps the digits of that one. A compiler that is allowed to reorder sums
 * (-ffast-math) would undo this.
 */
#include "mpc_forecast.h"
#include "mpc_battery_side.h"
#include "mpc_constants.h"
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"
#include "mpc_must_run.h"

static void add_to(mpc_sum *to, mpc_real value)
{
    const mpc_real total = to->sum + value;
    const mpc_real added = total - to->sum;
    to->lost += (to->sum - (total - added)) + (value - added);
    to->sum = total;
}

static mpc_real mean_of(const mpc_sum *of, mpc_real seconds)
{
    return (of->sum + of->lost) / seconds;
}

/* Hard driving, easy driving, braking; always 0 with one class. */
static int32_t class_of(mpc_real demand_w)
{
#if MPC_CLASSES > 1
    const int32_t easy_or_braking = (demand_w < mpc_par.class_braking_w) ? 2 : 1;
    return (demand_w > mpc_par.class_hard_w) ? 0 : easy_or_braking;
#else
    (void)demand_w;
    return 0;
#endif
}

/* First second of a block, if the short horizon ends before `first`; of the block after the last
 * that after the trip. See HorizonSettings.edges in Python. */
static int32_t edge_of(const mpc_forecast *forecast, int32_t first, int32_t block)
{
#if MPC_BLOCK_S > 0
    const int32_t at = block * MPC_BLOCK_S;
    const int32_t edge = (at > first) ? at : first;
#else
    const int32_t left = forecast->covered - first;
    const int32_t even = (block * left) / MPC_BLOCKS;
    const int32_t shortest = left - ((MPC_BLOCKS - block) * MPC_SHORT);
    const int32_t after = (even < shortest) ? even : shortest;
    const int32_t edge = first + ((after > 0) ? after : 0);
#endif
    return (edge < forecast->covered) ? edge : forecast->covered;
}

/* Whether the engine must run in a second of the trip; not before departure. */
static int32_t must_at(const mpc_forecast *forecast, int32_t second)
{
    int32_t must = 0;
    if (second >= 0) {
        must = must_run(battery_side_w(forecast->trip.demand_w[second]),
                        forecast->trip.speed_mps[second]);
    }
    return must;
}

/* Whether it runs then because it must, or had to begin a run lately, which lasts. */
static int32_t runs_at(const mpc_forecast *forecast, int32_t second)
{
    int32_t runs = must_at(forecast, second);
    int32_t earlier = must_at(forecast, second - 1);
    for (int32_t late = 1; late < mpc_par.min_on_s; late++) {
        const int32_t before = must_at(forecast, (second - late) - 1);
        runs |= earlier & (1 - before);
        earlier = before;
    }
    return runs;
}

/* Add one second of the trip to its class in a block, or subtract it: times 1 or -1. */
static void count(mpc_forecast *forecast, int32_t of_block, int32_t second, int32_t times)
{
    const mpc_real demand_w = forecast->trip.demand_w[second];
    const mpc_real net_w = battery_side_w(demand_w);
    mpc_class_sums *const block = &forecast->ahead[of_block * MPC_CLASSES];
    const int32_t of_class = class_of(demand_w);
    mpc_class_sums *const to = &block[of_class];
    const mpc_real sign = (mpc_real)times;
    /* departure is from the lowest class */
    const int32_t from = (second > 0) ? class_of(forecast->trip.demand_w[second - 1])
                                      : (MPC_CLASSES - 1);
    for (int32_t i = of_class; i < from; i++) {
        block[i].rises += times;
    }
    to->seconds += times;
    const int32_t must = runs_at(forecast, second);
    const mpc_real if_free = (must != 0) ? REAL(0.0) : sign;
    const mpc_real off_w = mpc_map_planned_internal_w(net_w);
    to->musts += times * must;
    add_to(&to->net_w, sign * net_w);
    add_to(&to->speed_mps, sign * forecast->trip.speed_mps[second]);
    add_to(&to->internal_off_w, sign * off_w);
    add_to(&to->free_net_w, if_free * net_w);
    add_to(&to->free_internal_off_w, if_free * off_w);
}

/* The same for some seconds, up to `end`. */
static void count_all(mpc_forecast *forecast, int32_t of_block, int32_t start, int32_t end,
                      int32_t times)
{
    for (int32_t second = start; second < end; second++) {
        count(forecast, of_block, second, times);
    }
}

/* All that is beyond the short horizon. */
static void sum_up(mpc_forecast *forecast, int32_t first)
{
    static const mpc_class_sums none = {0,
                                        0,
                                        0,
                                        {REAL(0.0), REAL(0.0)},
                                        {REAL(0.0), REAL(0.0)},
                                        {REAL(0.0), REAL(0.0)},
                                        {REAL(0.0), REAL(0.0)},
                                        {REAL(0.0), REAL(0.0)}};
    for (int32_t k = 0; k < MPC_LONG; k++) {
        forecast->ahead[k] = none;
    }
    for (int32_t block = 0; block < MPC_BLOCKS; block++) {
        count_all(forecast, block, edge_of(forecast, first, block),
                  edge_of(forecast, first, block + 1), 1);
    }
    forecast->next = first;
}

/* Internal battery power with the engine off. */
static mpc_real drained_w(mpc_real demand_w)
{
    return mpc_map_planned_internal_w(battery_side_w(demand_w));
}

/* How far the battery's energy falls below where a place begins and rises above where it ends, if
 * the engine makes up evenly in hard driving for all the rest; everywhere in a place without any.
 * An engine at rest is the least: a descent ends above. */
static mpc_swing swing_of(const mpc_forecast *forecast, int32_t first)
{
    const int32_t end = ((first + forecast->place_s) < forecast->covered)
                            ? (first + forecast->place_s)
                            : forecast->covered;
    mpc_sum drained = {REAL(0.0), REAL(0.0)};
    mpc_sum drained_hard = {REAL(0.0), REAL(0.0)};
    int32_t hard = 0;
    for (int32_t second = first; second < end; second++) {
        const mpc_real demand_w = forecast->trip.demand_w[second];
        const int32_t is_hard = (class_of(demand_w) == 0) ? 1 : 0;
        add_to((is_hard != 0) ? &drained_hard : &drained, drained_w(demand_w));
        hard += is_hard;
    }
    const int32_t seconds = end - first;
    const int32_t all = (seconds > 0) ? seconds : 1;
    const mpc_real balanced_w = mean_of(&drained, (mpc_real)((hard > 0) ? hard : all));
    const mpc_real resting_w = -mean_of(&drained_hard, (mpc_real)((hard > 0) ? hard : 1));
    const mpc_real repaid_w = real_max(balanced_w, resting_w);
    mpc_swing swing = {REAL(0.0), REAL(0.0)};
    mpc_sum level = {REAL(0.0), REAL(0.0)};
    for (int32_t second = first; second < end; second++) {
        const mpc_real demand_w = forecast->trip.demand_w[second];
        const int32_t is_hard = (class_of(demand_w) == 0) ? 1 : 0;
        add_to(&level, (is_hard != 0) ? REAL(0.0) : -drained_w(demand_w));
        add_to(&level, ((is_hard != 0) || (hard == 0)) ? repaid_w : REAL(0.0));
        const mpc_real now = level.sum + level.lost;
        swing.fall_j = real_max(swing.fall_j, -now);
        swing.rise_j = real_max(swing.rise_j, now);
    }
    const mpc_real above_start_j = real_max(level.sum + level.lost, REAL(0.0));
    swing.rise_j = real_max(swing.rise_j - above_start_j, REAL(0.0));
    return swing;
}

/* Energy that is kept from an SOC limit at most. */
static mpc_real most_kept_j(void)
{
    const mpc_real room = mpc_par.calibration.soc_max - mpc_par.calibration.soc_min;
    return FILLED_SHARE * room * mpc_par.battery_energy_j;
}

/* At the end of each place: a share of the swing in it and in the next, at most half of the room
 * between the limits and at least something, by which the end of a block is known; from the lower
 * limit less of it, because there the engine can help. An averaged
 * preview knows nothing of the swing. */
static void find_swings(mpc_forecast *forecast)
{
    const mpc_real most_j = most_kept_j();
    const mpc_real share = (MPC_CLASSES > 1) ? mpc_par.swing_share : REAL(0.0);
    mpc_swing next = {REAL(0.0), REAL(0.0)};
    for (int32_t place = MPC_BLOCKS - 1; place >= 0; place--) {
        const mpc_swing own = swing_of(forecast, place * forecast->place_s);
        mpc_swing *const kept = &forecast->swing[place];
        const mpc_real fall_j = real_min(share * real_max(own.fall_j, next.fall_j), most_j);
        kept->fall_j = real_max(FALL_SHARE * fall_j, LEAST_KEPT_J);
        kept->rise_j =
            real_max(real_min(share * real_max(own.rise_j, next.rise_j), most_j), LEAST_KEPT_J);
        next = own;
    }
}

/* Room below the upper SOC limit that the trip needs from a second on, from that of the next: what
 * braking gives, less a share of what driving with the engine off takes. */
static mpc_real room_before_j(const mpc_forecast *forecast, int32_t second, mpc_real next_j)
{
    const mpc_real internal_w = drained_w(forecast->trip.demand_w[second]);
    const mpc_real taken_w = (internal_w > REAL(0.0)) ? (DRAIN_SHARE * internal_w) : internal_w;
    return real_min(real_max(next_j - taken_w, REAL(0.0)), most_kept_j());
}

/* Seconds from one place of the trip to the next, if there are so many places, so far apart or more. */
static int32_t spacing_s(const mpc_forecast *forecast, int32_t places, int32_t least_s)
{
    const int32_t needed = (forecast->covered + (places - 1)) / places;
    return (needed > least_s) ? needed : least_s;
}

/* How far the battery's energy is below its last peak, after a second, from how far before it: what
 * driving with the engine off takes, hard driving apart, less what braking gives. */
static mpc_real drop_after_j(const mpc_forecast *forecast, int32_t second, mpc_real before_j)
{
    const mpc_real demand_w = forecast->trip.demand_w[second];
    const mpc_real internal_w = drained_w(demand_w);
    const mpc_real driving_w = (class_of(demand_w) == 0) ? REAL(0.0)
                                                         : (mpc_par.swing_share * internal_w);
    const mpc_real lost_w = (internal_w > REAL(0.0)) ? driving_w : internal_w;
    return real_min(real_max(before_j + lost_w, REAL(0.0)), most_kept_j());
}

/* The room at some places, and the most use of it in each stretch: for the braking to come, or for what
 * the battery has lost since its last peak. */
static void find_rooms(mpc_forecast *forecast)
{
    const int32_t spacing = spacing_s(forecast, MPC_ROOMS, MPC_ROOM_S);
    const int32_t length_s = spacing_s(forecast, MPC_STRETCHES, MPC_STRETCH_S);
    mpc_real room_j = REAL(0.0);
    mpc_real drop_j = REAL(0.0);
    for (int32_t k = 0; k < MPC_ROOMS; k++) {
        forecast->room_j[k] = REAL(0.0);
    }
    for (int32_t k = 0; k < MPC_STRETCHES; k++) {
        forecast->use_j[k] = REAL(0.0);
    }
    for (int32_t second = 0; second < forecast->covered; second++) {
        mpc_real *const use_j = &forecast->use_j[second / length_s];
        drop_j = drop_after_j(forecast, second, drop_j);
        *use_j = real_max(*use_j, drop_j);
    }
    for (int32_t second = forecast->covered - 1; second >= 0; second--) {
        mpc_real *const use_j = &forecast->use_j[second / length_s];
        *use_j = real_max(*use_j, room_j);
        room_j = room_before_j(forecast, second, room_j);
        if ((second % spacing) == 0) {
            forecast->room_j[second / spacing] = room_j;
        }
    }
}

/* The room from a second on; an averaged preview knows nothing of braking. */
static mpc_real room_from_j(const mpc_forecast *forecast, int32_t from)
{
    mpc_real room_j = REAL(0.0);
#if MPC_CLASSES > 1
    if ((from >= 0) && (from < forecast->covered)) {
        const int32_t spacing = spacing_s(forecast, MPC_ROOMS, MPC_ROOM_S);
        const int32_t place = (from / spacing) + 1;
        int32_t second = forecast->covered;
        if ((place * spacing) < forecast->covered) {
            second = place * spacing;
            room_j = forecast->room_j[place];
        }
        while (second > from) {
            second--;
            room_j = room_before_j(forecast, second, room_j);
        }
    }
#else
    (void)forecast;
    (void)from;
#endif
    return room_j;
}

static int32_t is_believable(const mpc_road *trip)
{
    int32_t fine = ((trip->steps >= 1) && (trip->steps <= MPC_LONGEST_TRIP_S)) ? 1 : 0;
    const int32_t steps = (fine != 0) ? trip->steps : 0;
    for (int32_t k = 0; k < steps; k++) {
        fine &= mpc_check_second(trip->demand_w[k], trip->speed_mps[k]);
    }
    return fine;
}

int32_t mpc_forecast_start(mpc_forecast *forecast, const mpc_road *trip)
{
    const int32_t fine = is_believable(trip);
    forecast->magic = MPC_MAGIC;
    forecast->magic_end = MPC_MAGIC;
    forecast->trip = *trip;
    if (fine == 0) {
        forecast->trip.steps = 0;
    }
    const int32_t steps = forecast->trip.steps;
#if MPC_BLOCK_S > 0
    const int32_t place_s = MPC_BLOCK_S;
#else
    const int32_t place_s = (steps + (MPC_BLOCKS - 1)) / MPC_BLOCKS;
#endif
    const int32_t held = place_s * MPC_BLOCKS;
    forecast->place_s = place_s;
    forecast->covered = (steps < held) ? steps : held;
    /* where the first second will ask for it */
    sum_up(forecast, (MPC_SHORT < forecast->covered) ? MPC_SHORT : forecast->covered);
    find_swings(forecast);
    find_rooms(forecast);
    return (fine != 0) ? 0 : -1;
}

/* Whether the memory is that of a forecast: no index from it leaves the trip or the blocks. */
static int32_t is_started(const mpc_forecast *forecast)
{
    const mpc_road *const trip = &forecast->trip;
    int32_t fine = ((forecast->magic == MPC_MAGIC) && (forecast->magic_end == MPC_MAGIC)) ? 1 : 0;
    fine &= ((trip->steps >= 0) && (trip->steps <= MPC_LONGEST_TRIP_S)) ? 1 : 0;
    fine &= ((forecast->covered >= 0) && (forecast->covered <= trip->steps)) ? 1 : 0;
    fine &= ((forecast->next >= 0) && (forecast->next <= forecast->covered)) ? 1 : 0;
    fine &= ((forecast->place_s >= 0) && (forecast->place_s <= MPC_LONGEST_TRIP_S)) ? 1 : 0;
    return ((fine != 0) && (forecast->covered <= (forecast->place_s * MPC_BLOCKS))) ? 1 : 0;
}

/* Move the bounds of the blocks on: what is beyond the short horizon begins at `from` now. */
static void leave_from(mpc_forecast *forecast, int32_t from)
{
    const int32_t old = forecast->next;
    const int32_t ahead = (from > 0) ? from : 0;
    const int32_t first = (ahead < forecast->covered) ? ahead : forecast->covered;
    if (first < old) {
        sum_up(forecast, first); /* the caller's time has gone back */
    } else {
        for (int32_t block = 0; block < MPC_BLOCKS; block++) {
            const int32_t old_start = edge_of(forecast, old, block);
            const int32_t old_end = edge_of(forecast, old, block + 1);
            const int32_t start = edge_of(forecast, first, block);
            const int32_t end = edge_of(forecast, first, block + 1);
            count_all(forecast, block, old_start, (start < old_end) ? start : old_end, -1);
            count_all(forecast, block, (old_end > start) ? old_end : start, end, 1);
        }
        forecast->next = first;
    }
}

static void fill_short(const mpc_road *seen, mpc_in *in)
{
    for (int32_t k = 0; k < MPC_SHORT; k++) {
        const int32_t ahead = (k < in->short_count) ? 1 : 0;
        in->short_demand_w[k] = (ahead != 0) ? seen->demand_w[k] : REAL(0.0);
        in->short_speed_mps[k] = (ahead != 0) ? seen->speed_mps[k] : REAL(0.0);
    }
}

/* What is kept at the end of a block: that of the place where it ends; nothing, if it is empty. From the
 * upper limit no more than there is a use for. At arrival the memory is not
 * looked at, which may be that of no forecast. */
static mpc_swing kept_of(const mpc_forecast *forecast, int32_t block, int32_t is_arriving)
{
    mpc_swing kept = {REAL(0.0), REAL(0.0)};
    if (is_arriving == 0) {
        const int32_t start = edge_of(forecast, forecast->next, block);
        const int32_t end = edge_of(forecast, forecast->next, block + 1);
        if (start < end) {
            kept = forecast->swing[(end - 1) / forecast->place_s];
            const mpc_real use_j =
                forecast->use_j[(end - 1) / spacing_s(forecast, MPC_STRETCHES, MPC_STRETCH_S)];
            kept.rise_j = real_max(real_min(kept.rise_j, use_j), LEAST_KEPT_J);
        }
    }
    return kept;
}

static void fill_class(const mpc_forecast *forecast, int32_t k, int32_t is_arriving, mpc_in *in)
{
    const mpc_class_sums *const of = &forecast->ahead[k];
    const int32_t is_masked = ((is_arriving != 0) || (of->seconds == 0)) ? 1 : 0;
    const mpc_real seconds = (is_masked != 0) ? REAL(1.0) : (mpc_real)of->seconds;
    const mpc_real share = (is_masked != 0) ? REAL(0.0) : REAL(1.0);
    in->long_duration_s[k] = share * seconds;
    in->long_net_w[k] = share * mean_of(&of->net_w, seconds);
    in->long_speed_mps[k] = share * mean_of(&of->speed_mps, seconds);
    in->long_rises[k] = (is_arriving != 0) ? REAL(0.0) : (mpc_real)of->rises;
    /* with one class the preview is averaged: it has only the mean demand */
#if MPC_CLASSES > 1
    in->long_internal_off_w[k] = share * mean_of(&of->internal_off_w, seconds);
    in->long_must_share[k] = share * ((mpc_real)of->musts / seconds);
    /* where none is free, the means of all */
    const int32_t some = ((is_masked == 0) && (of->seconds > of->musts)) ? 1 : 0;
    const mpc_real left_s = (mpc_real)of->seconds - (mpc_real)of->musts; /* no overflow */
    const mpc_real free_s = (some != 0) ? left_s : REAL(1.0);
    in->long_free_net_w[k] = (some != 0) ? mean_of(&of->free_net_w, free_s) : in->long_net_w[k];
    in->long_free_internal_off_w[k] = (some != 0) ? mean_of(&of->free_internal_off_w, free_s)
                                                  : in->long_internal_off_w[k];
#else
    in->long_must_share[k] = (mpc_real)must_run(in->long_net_w[k], in->long_speed_mps[k]);
    in->long_internal_off_w[k] = mpc_map_planned_internal_w(in->long_net_w[k]);
    in->long_free_net_w[k] = in->long_net_w[k];
    in->long_free_internal_off_w[k] = in->long_internal_off_w[k];
#endif
}

static void fill_long(const mpc_forecast *forecast, int32_t is_arriving, mpc_in *in)
{
    for (int32_t block = 0; block < MPC_BLOCKS; block++) {
        const mpc_swing kept = kept_of(forecast, block, is_arriving);
        for (int32_t k = block * MPC_CLASSES; k < ((block + 1) * MPC_CLASSES); k++) {
            fill_class(forecast, k, is_arriving, in);
            in->long_fall_j[k] = kept.fall_j;
            in->long_rise_j[k] = kept.rise_j;
        }
    }
}

/* Apart from mpc_in_from_preview, which nothing in this file may call alone (MISRA C:2012 8.7). */
static int32_t fill(mpc_forecast *forecast, int32_t step, int32_t beyond, const mpc_road *seen,
                    mpc_in *in)
{
    const int32_t is_ahead = ((step >= 0) && (seen->steps > 0)) ? 1 : 0;
    const int32_t is_under_way = is_ahead & is_started(forecast);
    const int32_t ahead = (is_under_way != 0) ? seen->steps : 0;
    const int32_t is_arriving = (ahead <= MPC_SHORT) ? 1 : 0;
    in->short_count = (is_arriving != 0) ? ahead : MPC_SHORT;
    in->second = step;
    if (is_arriving == 0) {
        leave_from(forecast, beyond);
    }
    fill_short(seen, in);
    fill_long(forecast, is_arriving, in);
    in->short_rise_j = (is_arriving == 0) ? room_from_j(forecast, beyond) : REAL(0.0);
    return (is_under_way != 0) ? 0 : -1;
}

int32_t mpc_in_from_forecast(mpc_forecast *forecast, int32_t step, mpc_in *in)
{
    const mpc_road *const trip = &forecast->trip;
    const int32_t is_ahead = ((step >= 0) && (step < trip->steps)) ? 1 : 0;
    const int32_t is_under_way = is_ahead & is_started(forecast);
    const int32_t from = (is_under_way != 0) ? step : 0;
    mpc_road seen = *trip;
    seen.steps = (is_under_way != 0) ? (trip->steps - from) : 0;
    if (is_under_way != 0) {
        seen.demand_w = &trip->demand_w[from];
        seen.speed_mps = &trip->speed_mps[from];
    }
    return fill(forecast, step, from + MPC_SHORT, &seen, in);
}

int32_t mpc_in_from_preview(mpc_forecast *forecast, int32_t step, int32_t beyond,
                            const mpc_road *seen, mpc_in *in)
{
    return fill(forecast, step, beyond, seen, in);
}

int32_t mpc_forecast_bytes(void) { return (int32_t)sizeof(mpc_forecast); }
