/* On or off at the multipliers found, at least cost: a shortest path over the seconds ahead, whose
 * states are on or off and for how long the engine has to stay so; in a block all choices. The same
 * in Python: qpmpc/costate/path.py.
 */
#include "mpc_costate_parts.h"
#include "mpc_model.h"
#include "mpc_real.h"

#define FORBIDDEN_G REAL(1.0e20)

/* What is to come from each state on, g: by the seconds before a change is allowed. */
typedef struct {
    mpc_real on[MPC_RUN_STATES];
    mpc_real off[MPC_REST_STATES];
} to_come;

/* Which states change in a second, bit by bit. */
typedef struct {
    uint32_t on;
    uint32_t off;
} changes;

static mpc_real start_g(const mpc_costate_dual *cost)
{
#if MPC_STARTS
    return cost->start_g;
#else
    (void)cost;
    return REAL(0.0);
#endif
}

static mpc_real stage_rises(const mpc_stage *stage)
{
#if MPC_STARTS
    return stage->p.rises;
#else
    (void)stage;
    return REAL(0.0);
#endif
}

static int32_t one_less(int32_t count)
{
    const int32_t less = count - 1;
    return (less > 0) ? less : 0;
}

static uint32_t bit(int32_t is_set, int32_t place)
{
    const uint32_t value = (uint32_t)is_set;
    const uint32_t by = (uint32_t)place;
    return value << by;
}

static int32_t has_bit(uint32_t bits, int32_t place)
{
    const uint32_t by = (uint32_t)place;
    const uint32_t found = (bits >> by) & 1U;
    return (int32_t)found;
}

/* One second, from the end. */
static changes step_back(const mpc_stage *stage, const mpc_costate_dual *cost, int32_t may_start,
                         to_come *after)
{
    const mpc_real driven = above(stage->road.duration_s, REAL(0.0));
    const int32_t is_driven = (int32_t)driven;
    const int32_t must = (int32_t)stage->p.must;
    const int32_t cannot = (int32_t)stage->p.cannot;
    const mpc_real stopped = cost->off_g + after->off[MPC_REST_STATES - 1];
    const mpc_real started = (cost->on_g[MPC_FREE] + start_g(cost)) + after->on[MPC_RUN_STATES - 1];
    changes found = {0U, 0U};
    for (int32_t r = MPC_RUN_STATES - 1; r >= 0; r--) {
        const mpc_real stay = cost->on_g[MPC_FREE] + after->on[one_less(r)];
        const int32_t better = (1 - must) & ((r == 0) ? 1 : 0) & ((stopped < stay) ? 1 : 0);
        const int32_t turns = is_driven & (cannot | better);
        after->on[r] = blend(driven, blend((mpc_real)turns, stopped, stay), after->on[r]);
        found.on |= bit(turns, r);
    }
    for (int32_t r = MPC_REST_STATES - 1; r >= 0; r--) {
        const mpc_real stay = cost->off_g + after->off[one_less(r)];
        const int32_t better = (1 - cannot) & may_start & ((r == 0) ? 1 : 0)
                               & ((started < stay) ? 1 : 0);
        const int32_t turns = is_driven & (must | better);
        after->off[r] = blend(driven, blend((mpc_real)turns, started, stay), after->off[r]);
        found.off |= bit(turns, r);
    }
    return found;
}

static int32_t at_most(int32_t value, int32_t most) { return (value < most) ? value : most; }

/* The path of the seconds ahead, into the on-shares of x; returns its cost. */
static mpc_real shortest_path(mpc_state *state)
{
    const int32_t which = state->search.here;
    const mpc_measured *const seen = &state->watch.good;
    to_come after;
    changes turns[MPC_SHORT];
    int32_t seconds = 0;
    for (int32_t r = 0; r < MPC_RUN_STATES; r++) {
        after.on[r] = REAL(0.0);
    }
    for (int32_t r = 0; r < MPC_REST_STATES; r++) {
        after.off[r] = REAL(0.0);
    }
    for (int32_t k = 0; k < MPC_SHORT; k++) {
        seconds += (state->stage[k].road.duration_s > REAL(0.0)) ? 1 : 0;
    }
    /* no start that arrival would end early */
    const int32_t shortest_s = (mpc_par.min_on_s > 1) ? mpc_par.min_on_s : 1;
    const int32_t last_start = seconds - ((seconds < MPC_SHORT) ? shortest_s : 0);
    for (int32_t k = MPC_SHORT - 1; k >= 0; k--) {
        const mpc_stage *const stage = &state->stage[k];
        turns[k] = step_back(stage, &stage->dual[which], (k <= last_start) ? 1 : 0, &after);
    }
    int32_t on = seen->engine_on;
    const int32_t for_s = (seen->engine_for_s > 1) ? seen->engine_for_s : 1;
    int32_t left = ((on != 0) ? mpc_par.min_on_s : mpc_par.min_off_s) - for_s;
    left = at_most((left > 0) ? left : 0, ((on != 0) ? MPC_RUN_STATES : MPC_REST_STATES) - 1);
    const mpc_real cost = (on != 0) ? after.on[at_most(left, MPC_RUN_STATES - 1)]
                                    : after.off[at_most(left, MPC_REST_STATES - 1)];
    for (int32_t k = 0; k < MPC_SHORT; k++) {
        mpc_stage *const stage = &state->stage[k];
        const uint32_t bits = (on != 0) ? turns[k].on : turns[k].off;
        const int32_t turn = has_bit(bits, left);
        on ^= turn;
        const int32_t fresh = ((on != 0) ? MPC_RUN_STATES : MPC_REST_STATES) - 1;
        left = (turn != 0) ? fresh : one_less(left);
        const int32_t is_driven = (k < seconds) ? 1 : 0;
        stage->x[MPC_VAR_ON] = pick(is_driven, (mpc_real)on, stage->dual[which].share);
    }
    return cost;
}

/* Least cost of a block, whose stages are coupled by starts alone: of all choices of on and off up
 * to a stage the best that end on, and off. */
static mpc_real block_least(const mpc_stage *block, int32_t which)
{
    mpc_real on = REAL(0.0);
    mpc_real off = REAL(0.0);
    mpc_real forced = REAL(0.0);
    for (int32_t i = 0; i < MPC_CLASSES; i++) {
        const mpc_stage *const stage = &block[i];
        const mpc_costate_dual *const cost = &stage->dual[which];
        /* from one stage to the next a class rises or falls: the first of a block does neither */
        const mpc_real rising = start_g(cost) * real_max(stage_rises(stage), REAL(0.0));
        const mpc_real falling = start_g(cost) * real_max(-stage_rises(stage), REAL(0.0));
        const mpc_real to_on = real_min(on, off + rising);
        const mpc_real to_off = real_min(off, on + falling);
        on = to_on + cost->on_g[MPC_FREE] + (stage->p.cannot * FORBIDDEN_G);
        off = to_off + cost->off_g + (stage->p.must * FORBIDDEN_G);
        forced += cost->on_g[MPC_FORCED];
    }
    return real_min(on, off) + forced;
}

mpc_real mpc_costate_choose(mpc_state *state)
{
    mpc_real cost = shortest_path(state);
    for (int32_t i = 0; i < MPC_BLOCKS; i++) {
        const int32_t first = MPC_SHORT + (MPC_CLASSES * i);
        cost += block_least(&state->stage[first], state->search.here);
        for (int32_t j = 0; j < MPC_CLASSES; j++) {
            mpc_stage *const stage = &state->stage[first + j];
            stage->x[MPC_VAR_ON] = stage->dual[state->search.here].share;
        }
    }
    return cost;
}
