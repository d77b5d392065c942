/* A running sum kept within limits at least cost: the prices of its terms, in one walk.
 *
 * x_k = x_{k-1} + offset_k + response_k p_k, x before the first = 0. Along a stretch the price goes on,
 * and each limit is an interval of prices; where their common interval becomes empty the stretch ends
 * at the limit that made its nearer bound, and the walk goes on from there; it ends at once where the
 * limits leave one value alone. It has a fixed number of steps, those after the end without effect.
 *
 * The same in Python, with the derivation: qpmpc/costate/funnel.py.
 */
#include "mpc_constants.h"
#include "mpc_costate_parts.h"
#include "mpc_real.h"

#define SURELY REAL(1.0e37) /* times any difference of two prices is 1 or more */

/* 1 where a is above b, else 0, without a comparison that a compiler could make a branch of. */
static inline mpc_real surely_above(mpc_real a, mpc_real b)
{
    return real_min(real_max((a - b) * SURELY, REAL(0.0)), REAL(1.0));
}

/* A term beyond the last, which moves so easily that its limits leave the price 0 alone: where that
 * is met the walk ends. */
static void put_end(mpc_costate_term *end)
{
    const mpc_costate_term zero = {
        REAL(0.0), ENDLESS_RESPONSE, {REAL(0.0), REAL(0.0)}, MPC_NO_PRICE};
    *end = zero;
}

/* Places are counted in mpc_real, which holds them exactly, so that choices are arithmetic. */
void mpc_costate_funnel(mpc_search *search, int32_t count, int32_t steps)
{
    mpc_costate_term *const term = search->term;
    const mpc_real last = (mpc_real)count;
    mpc_real least = -UNLIMITED; /* bounds of the stretch's price at the present term */
    mpc_real most = UNLIMITED;
    mpc_real least_at = REAL(0.0); /* where they were made */
    mpc_real most_at = REAL(0.0);
    mpc_real x = REAL(0.0);
    mpc_real moves = REAL(0.0);
    mpc_real k = REAL(0.0);
    put_end(&term[count]);
    for (int32_t step = 0; step < steps; step++) {
        const mpc_costate_term *const own = &term[(int32_t)k];
        x += own->offset;
        moves += own->response;
        const mpc_real movable = above(moves, LEAST_RESPONSE);
        const mpc_real per_move = movable / real_max(moves, LEAST_RESPONSE);
        const mpc_real far = UNLIMITED - (UNLIMITED * movable);
        const mpc_real low = ((own->limit[0] - x) * per_move) - far;
        const mpc_real high = ((own->limit[1] - x) * per_move) + far;
        least_at = (low >= least) ? k : least_at; /* always where a stretch begins */
        most_at = (high <= most) ? k : most_at;
        least = real_max(least, low);
        most = real_min(most, high);
        /* where one bound has met the other the stretch ends, at the older of them */
        const mpc_real goes_on = surely_above(most, least);
        const mpc_real ended = REAL(1.0) - goes_on;
        const mpc_real at = real_min(least_at, most_at);
        const int32_t by_most = (most_at < least_at) ? 1 : 0;
        mpc_costate_term *const older = &term[(int32_t)at];
        older->price = pick(by_most, most, least) + (goes_on * MPC_NO_PRICE);
        x = (goes_on * x) + (ended * older->limit[by_most]);
        moves *= goes_on;
        least = (goes_on * least) - (ended * UNLIMITED);
        most = (goes_on * most) + (ended * UNLIMITED);
        const mpc_real next = (goes_on * (k + REAL(1.0))) + (ended * (at + REAL(1.0)));
        k = real_min(next, last);
    }
    /* of a walk cut short, the rest has the price that meets the limits seen */
    mpc_real price = real_max(least, real_min(most, REAL(0.0)));
    for (int32_t i = count - 1; i >= 0; i--) {
        price = pick((term[i].price < UNLIMITED) ? 1 : 0, term[i].price, price);
        term[i].price = price;
    }
}
