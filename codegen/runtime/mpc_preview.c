/* Check of the preview: possible for this car, and going on from the one received before.
 *
 * Each second that passes takes at most a second, and what is driven in it, out of the statistics
 * of the trip and over the bounds of blocks that move on, out of one and into the other. The same
 * message again is not news; NEWS is the share of the trip that may change beside that. A new route
 * is therefore used from its second second on.
 */
#include "mpc_constants.h"
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"

static int32_t are_powers(mpc_real net_w, mpc_real internal_off_w)
{
    return within(net_w, mpc_par.can_net_min_w, mpc_par.can_net_max_w)
           & within(internal_off_w, mpc_par.can_internal_min_w, mpc_par.can_internal_max_w);
}

static int32_t is_stage(mpc_real duration_s, mpc_real speed_mps, mpc_real must_share,
                        mpc_real rises, mpc_real fall_j, mpc_real rise_j)
{
    return within(duration_s, REAL(0.0), LONGEST_STAGE_S)
           & within(speed_mps, REAL(0.0), mpc_par.can_speed_max_mps)
           & within(must_share, REAL(0.0), REAL(1.0)) & within(rises, REAL(0.0), LONGEST_STAGE_S)
           & within(fall_j, REAL(0.0), mpc_par.can_energy_j)
           & within(rise_j, REAL(0.0), mpc_par.can_energy_j);
}

/* Energy, J, by which the means over the seconds with a choice differ from those over all, where all
 * have one: 0 but for rounding, if the caller knows them. */
static mpc_real untold_j(const mpc_in *in, int32_t k)
{
    const mpc_real apart_w =
        REAL_ABS(in->long_free_net_w[k] - in->long_net_w[k])
        + REAL_ABS(in->long_free_internal_off_w[k] - in->long_internal_off_w[k]);
    return (in->long_must_share[k] > REAL(0.0)) ? REAL(0.0) : (in->long_duration_s[k] * apart_w);
}

static int32_t is_possible(const mpc_in *in)
{
    int32_t fine = ((in->short_count >= 1) && (in->short_count <= MPC_SHORT)) ? 1 : 0;
    mpc_real total_s = REAL(0.0);
    mpc_real apart_j = REAL(0.0);
    fine &= within(in->short_rise_j, REAL(0.0), mpc_par.can_energy_j);
    for (int32_t k = 0; k < MPC_SHORT; k++) {
        fine &= mpc_check_second(in->short_demand_w[k], in->short_speed_mps[k]);
    }
    for (int32_t k = 0; k < MPC_LONG; k++) {
        fine &= is_stage(in->long_duration_s[k], in->long_speed_mps[k], in->long_must_share[k],
                         in->long_rises[k], in->long_fall_j[k], in->long_rise_j[k]);
        fine &= are_powers(in->long_net_w[k], in->long_internal_off_w[k]);
        fine &= are_powers(in->long_free_net_w[k], in->long_free_internal_off_w[k]);
        total_s += in->long_duration_s[k];
        apart_j += untold_j(in, k);
    }
    fine &= within(apart_j, REAL(0.0), SAME_MEANS_W * total_s);
    return fine;
}

/* Whether the stages in memory, to be used again, are what a preview can have left there. */
int32_t mpc_preview_check_kept(const mpc_state *state)
{
    int32_t fine = 1;
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        const mpc_stage_road *const road = &state->stage[k].road;
        fine &= is_stage(road->duration_s, road->speed_mps, road->must_share, REAL_ABS(road->rises),
                         real_max(road->fall_j, REAL(0.0)), real_max(road->rise_j, REAL(0.0)));
        fine &= are_powers(road->net_w, road->internal_off_w);
        fine &= are_powers(road->free_net_w, road->free_internal_off_w);
    }
    return fine;
}

/* The same message once more. */
static int32_t is_same(const mpc_heard *before, const mpc_in *in)
{
    int32_t same = (before->short_count == in->short_count) ? 1 : 0;
    for (int32_t k = 0; k < MPC_SHORT; k++) {
        same &= within(in->short_demand_w[k], before->short_demand_w[k], before->short_demand_w[k]);
    }
    for (int32_t k = 0; k < MPC_LONG; k++) {
        same &=
            within(in->long_duration_s[k], before->long_duration_s[k], before->long_duration_s[k]);
    }
    return same;
}

/* Seconds that may change in a second: two where a bound moves on, of blocks that share out the rest of
 * the trip, else one that is over, with room for a place that catches up. */
#if MPC_BLOCK_S > 0
#define MOVED_S REAL(2.0)
#else
#define MOVED_S (REAL(2.0) * (mpc_real)MPC_BLOCKS)
#endif

static int32_t goes_on(const mpc_heard *before, const mpc_in *in)
{
    mpc_real total_s = REAL(0.0);
    mpc_real moved_s = REAL(0.0);
    mpc_real moved_net_j = REAL(0.0);
    mpc_real moved_internal_j = REAL(0.0);
    mpc_real news_w = REAL(0.0);
    for (int32_t k = 0; k < MPC_LONG; k++) {
        const mpc_real old_s = before->long_duration_s[k];
        const mpc_real new_s = in->long_duration_s[k];
        total_s += old_s;
        moved_s += REAL_ABS(new_s - old_s);
        moved_net_j += REAL_ABS((new_s * in->long_net_w[k]) - (old_s * before->long_net_w[k]));
        moved_internal_j += REAL_ABS((new_s * in->long_internal_off_w[k])
                                     - (old_s * before->long_internal_off_w[k]));
    }
    for (int32_t k = 0; k < MPC_SHORT; k++) {
        const int32_t from = (before->age < MPC_SHORT) ? (k + before->age) : MPC_SHORT;
        const mpc_real seen = (from < MPC_SHORT) ? REAL(1.0) : REAL(0.0);
        const mpc_real old_w = before->short_demand_w[(from < MPC_SHORT) ? from : 0];
        news_w += seen * REAL_ABS(in->short_demand_w[k] - old_w);
    }
    const mpc_real free_s = (MOVED_S * (mpc_real)before->age) + (NEWS * total_s);
    const mpc_real net_w = mpc_par.can_net_max_w - mpc_par.can_net_min_w;
    const mpc_real internal_w = mpc_par.can_internal_max_w - mpc_par.can_internal_min_w;
    int32_t fine = within(moved_s, REAL(0.0), free_s);
    fine &= within(moved_net_j, REAL(0.0), free_s * net_w);
    fine &= within(moved_internal_j, REAL(0.0), free_s * internal_w);
    fine &= within(news_w, REAL(0.0), NEWS * (mpc_real)MPC_SHORT * mpc_par.can_net_max_w);
    return fine;
}

static void hear(mpc_heard *heard, const mpc_in *in)
{
    for (int32_t k = 0; k < MPC_SHORT; k++) {
        heard->short_demand_w[k] = in->short_demand_w[k];
    }
    for (int32_t k = 0; k < MPC_LONG; k++) {
        heard->long_duration_s[k] = in->long_duration_s[k];
        heard->long_net_w[k] = in->long_net_w[k];
        heard->long_internal_off_w[k] = in->long_internal_off_w[k];
    }
    heard->short_count = in->short_count;
    heard->age = 0;
}

/* For a departure: this preview has none before it. */
int32_t mpc_preview_first(mpc_heard *heard, const mpc_in *in)
{
    const int32_t possible = is_possible(in);
    if (possible != 0) {
        hear(heard, in);
    }
    return possible;
}

int32_t mpc_preview_check(mpc_heard *heard, const mpc_in *in, int32_t elapsed)
{
    heard->age = ((heard->age + elapsed) < MPC_NO_PLAN) ? (heard->age + elapsed) : MPC_NO_PLAN;
    const int32_t possible = is_possible(in);
    const int32_t is_old = is_same(heard, in); /* always: it takes time */
    const int32_t is_news = ((heard->age == 0) || (is_old == 0)) ? 1 : 0;
    const int32_t follows = goes_on(heard, in) & is_news;
    const int32_t fine = possible & ((heard->age == MPC_NO_PLAN) ? 1 : follows);
    if (possible != 0) {
        hear(heard, in);
    }
    return fine;
}
