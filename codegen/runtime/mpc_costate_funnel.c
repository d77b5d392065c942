/* A running sum kept within limits at least cost: the prices of its terms, in one walk.
 *
 * x_k = d_k x_{k-1} + offset_k + response_k p_k, x before the first = 0. Along a stretch the price
 * goes on, d_k p_k = p_{k-1}, and each limit is an interval of prices; where their common interval
 * becomes empty the stretch ends at the limit that made its nearer bound, and the walk goes on from
 * there; it ends at once where the limits leave one value alone. It has a fixed number of steps,
 * those after the end without effect.
 *
 * The same in Python, with the derivation: qpmpc/costate/funnel.py.
 */
#include "mpc_constants.h"
#include "mpc_costate_parts.h"
#include "mpc_real.h"

#if MPC_F32
#define TIE REAL(1.0e-6)
#else
#define TIE REAL(1.0e-12)
#endif

/* A bound of the stretch's price at the present term; where it was made, the price there, and x. */
typedef struct {
    mpc_real price;
    mpc_real at;
    mpc_real own;
    mpc_real x;
} bound;

static void set_bound(bound *of, mpc_real is_new, mpc_real at, mpc_real price, mpc_real x)
{
    of->at = blend(is_new, at, of->at);
    of->own = blend(is_new, price, of->own);
    of->x = blend(is_new, x, of->x);
}

/* A term beyond the last, whose limit is the price 0: where that is met the walk ends. */
static void put_end(mpc_costate_term *end)
{
    const mpc_costate_term zero = {REAL(0.0), REAL(1.0), REAL(0.0), REAL(0.0),
                                   REAL(0.0), REAL(1.0), REAL(0.0), REAL(0.0)};
    *end = zero;
}

/* Places are counted in mpc_real, which holds them exactly, so that all choices are arithmetic. */
void mpc_costate_funnel(mpc_search *search, int32_t count, int32_t steps)
{
    mpc_costate_term *const term = search->term;
    const mpc_real last = (mpc_real)count;
    const mpc_real nowhere = last + REAL(1.0);
    bound least = {-UNLIMITED, REAL(0.0), REAL(0.0), REAL(0.0)};
    bound most = {UNLIMITED, REAL(0.0), REAL(0.0), REAL(0.0)};
    mpc_real x = REAL(0.0);
    mpc_real moves = REAL(0.0);
    mpc_real k = REAL(0.0);
    for (int32_t i = 0; i < count; i++) {
        term[i].ends = REAL(0.0);
    }
    put_end(&term[count]);
    for (int32_t step = 0; step < steps; step++) {
        const mpc_costate_term *const own = &term[(int32_t)k];
        x = (own->decay * x) + own->offset;
        moves = (own->decay * own->decay * moves) + own->response;
        least.price = real_max(least.price * own->per_decay, -UNLIMITED);
        most.price = real_min(most.price * own->per_decay, UNLIMITED);
        const mpc_real movable = above(moves, LEAST_RESPONSE);
        const mpc_real per_move = movable / real_max(moves, LEAST_RESPONSE);
        const mpc_real far = UNLIMITED - (UNLIMITED * movable);
        const mpc_real low = ((own->low - x) * per_move) - far;
        const mpc_real high = ((own->high - x) * per_move) + far;
        /* the stretch ends at the lower bound, the upper one, or here, or it goes on */
        const mpc_real at_least = above(least.price, high + (TIE * REAL_ABS(high)));
        const mpc_real at_most = (REAL(1.0) - at_least)
                                 * above(low - (TIE * REAL_ABS(low)), most.price);
        const mpc_real is_low = not_below(low, least.price);
        set_bound(&least, is_low, k, low, own->low);
        set_bound(&most, not_below(most.price, high), k, high, own->high);
        least.price = real_max(least.price, low);
        most.price = real_min(most.price, high);
        const mpc_real here = ((REAL(1.0) - at_least) - at_most)
                              * not_below(least.price, most.price);
        const mpc_real by_least = at_least + (here * is_low);
        const mpc_real ended = at_least + at_most + here;
        const mpc_real by_most = ended - by_least;
        const mpc_real goes_on = REAL(1.0) - ended;
        const mpc_real at = (by_least * least.at) + (by_most * most.at);
        const mpc_real place = at + (goes_on * nowhere);
        mpc_costate_term *const written = &term[(int32_t)place];
        written->price = (by_least * least.own) + (by_most * most.own);
        written->ends = REAL(1.0);
        x = ((by_least * least.x) + (by_most * most.x)) + (goes_on * x);
        moves *= goes_on;
        least.price = (goes_on * least.price) - (ended * UNLIMITED);
        most.price = (goes_on * most.price) + (ended * UNLIMITED);
        k = real_min((at + (goes_on * k)) + REAL(1.0), last);
    }
    /* of a walk cut short, the rest has the price that meets the limits seen; 0 at the end */
    const mpc_real nearest = real_max(least.price, real_min(most.price, REAL(0.0)));
    mpc_real price = nearest;
    for (int32_t i = count - 1; i >= 0; i--) {
        price = blend(term[i].ends, term[i].price, price);
        term[i].price = price;
        price *= term[i].decay;
    }
}
