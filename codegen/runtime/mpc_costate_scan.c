/* A running sum that decays, each term with one limit, kept within them at least cost: one scan.
 *
 * x_k = d_k x_{k-1} + offset_k + response_k p_k, x before the first = 0. The price goes on,
 * d_k p_k = p_{k-1}, but for a jump at a limit that is met. Each term comes once; its limit is taken
 * to be met, by one price since the last that is. Where that leaves the last one a jump of the wrong
 * sign, that is not met, and two stretches become one. So steps of twice
 * the terms and one suffice, and those after the end have no effect.
 *
 * The same in Python, with what it solves: qpmpc/costate/scan.py.
 */
#include "mpc_constants.h"
#include "mpc_costate_parts.h"
#include "mpc_real.h"

#define NONE 0
#define END (MPC_STAGES + 1)

/* The stretch before the first, which has no limit, so that nothing takes it away, not even an infinite
 * price, and changes none that it joins; the term after the last moves so easily that its price is 0. */
static void put_ends(mpc_costate_stretch *stretch)
{
    static const mpc_costate_stretch none = {REAL(0.0), REAL(0.0), REAL(1.0), REAL(0.0),
                                             REAL(0.0), REAL(0.0), REAL(0.0), 0};
    static const mpc_costate_stretch end = {REAL(0.0), ENDLESS_RESPONSE, REAL(1.0), REAL(0.0),
                                            REAL(1.0), REAL(0.0),        REAL(0.0), 0};
    stretch[NONE] = none;
    stretch[END] = end;
}

/* One stretch and the next as one. */
static inline void join(const mpc_costate_stretch *one, const mpc_costate_stretch *next,
                        mpc_costate_stretch *both)
{
    const mpc_real decay = next->decay;
    const mpc_real offset = (one->offset * decay) + next->offset;
    const mpc_real response = (one->response * decay * decay) + next->response;
    both->decay = one->decay * decay;
    both->limit = next->limit;
    both->side = next->side;
    both->offset = offset;
    both->response = response;
}

/* The stretches whose limits are met are the first of the memory, and the present one comes after them;
 * these places are those of terms that have come. */
void mpc_costate_scan(mpc_search *search)
{
    mpc_costate_stretch *const stretch = search->stretch;
    int32_t met = NONE;
    int32_t k = 1;
    put_ends(stretch);
    for (int32_t step = 0; step < ((2 * MPC_STAGES) + 1); step++) {
        mpc_costate_stretch *const last = &stretch[met];
        mpc_costate_stretch *const now = &stretch[met + 1];
        const mpc_costate_stretch *const after = &stretch[k + 1];
        const mpc_real misses = (now->limit - (now->decay * last->limit)) - now->offset;
        const mpc_real price = misses / real_max(now->response, LEAST_RESPONSE);
        const mpc_real jump = last->price - (now->decay * price);
        const int32_t counts = (now->side != REAL(0.0)) ? 1 : 0;
        const int32_t wrong = ((last->side * jump) < REAL(0.0)) ? 1 : 0;
        const int32_t goes = counts & wrong;                    /* the last limit */
        const int32_t comes = ((k < END) ? 1 : 0) & (1 - goes); /* the next term */
        const int32_t meets = counts & comes;                   /* the present limit */
        const int32_t first = (goes * met) + ((comes - meets) * (met + 1));
        const mpc_costate_stretch *const next = (comes != 0) ? after : now;
        last->jump = jump;
        now->price = price;
        now->at = k;
        k += comes;
        met += meets - goes;
        join(&stretch[first], next, &stretch[met + 1]);
    }
    search->met = met;
}
