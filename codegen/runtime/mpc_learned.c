/* Level and tilt of the fuel map by least squares, forgetful and bounded, from the fuel injected.
 *
 * The same in Python, with the formulas: qpmpc/pwa/learned_fuel.py.
 */
#include "mpc_learned.h"

#include "mpc_constants.h"
#include "mpc_parts.h"
#include "mpc_real.h"

/* Place of a power between -1, idling, and 1, full power. */
static mpc_real place(mpc_real p_eng_w)
{
    return ((REAL(2.0) * p_eng_w) / mpc_par.engine_max_w) - REAL(1.0);
}

/* The greatest power also stands for one that is not known, and teaches nothing. */
void mpc_learned_take(mpc_state *state)
{
    const mpc_measured *const good = &state->watch.good;
    mpc_learned *const of = &state->learned;
    const mpc_real p_eng_w = good->p_eng_before_w;
    if ((good->engine_on != 0) && (p_eng_w < mpc_par.engine_max_w)) {
        const mpc_real start_g = (good->engine_for_s == 1) ? mpc_par.start_fuel_g : REAL(0.0);
        const mpc_real map_g = mpc_map_cold_factor(good->t_cl_degc) * mpc_map_fuel_g_per_s(p_eng_w);
        const mpc_real ratio = (good->fuel_g - start_g) / map_g;
        if (within(ratio, RATIO_LEAST, RATIO_MOST) != 0) {
            const mpc_real p = place(p_eng_w);
            of->one = (KEPT * of->one) + REAL(1.0);
            of->p = (KEPT * of->p) + p;
            of->pp = (KEPT * of->pp) + (p * p);
            of->r = (KEPT * of->r) + ratio;
            of->rp = (KEPT * of->rp) + (ratio * p);
        }
    }
}

/* Chord of the learned curve, before it is made convex. */
static mpc_real chord(const mpc_real *fuel, int32_t i, int32_t j)
{
    return (fuel[j] - fuel[i]) / (mpc_par.learned_power_w[j] - mpc_par.learned_power_w[i]);
}

void mpc_learned_curve(mpc_state *state)
{
    mpc_learned *const of = &state->learned;
    const mpc_real a = of->one + PRIOR_S;
    const mpc_real c = of->pp + PRIOR_S;
    const mpc_real r = of->r + PRIOR_S;
    const mpc_real divisor = real_max((a * c) - (of->p * of->p), PRIOR_S * PRIOR_S);
    const mpc_real level = real_clip(((c * r) - (of->p * of->rp)) / divisor, REAL(1.0) - LEVEL_MOST,
                                     REAL(1.0) + LEVEL_MOST);
    const mpc_real tilt = real_clip(((a * of->rp) - (of->p * r)) / divisor, -TILT_MOST, TILT_MOST);
    mpc_real fuel[MPC_FUEL_PIECES + 1];
    for (int32_t k = 0; k <= MPC_FUEL_PIECES; k++) {
        const mpc_real factor = level + (tilt * place(mpc_par.learned_power_w[k]));
        fuel[k] = mpc_par.learned_map_g_per_s[k] * factor;
    }
    mpc_real value = fuel[0];
    for (int32_t k = 0; k < MPC_FUEL_PIECES; k++) {
        mpc_real most = chord(fuel, 0, k + 1);
        for (int32_t i = 0; i <= k; i++) {
            mpc_real least = chord(fuel, i, k + 1);
            for (int32_t j = k + 2; j <= MPC_FUEL_PIECES; j++) {
                least = real_min(least, chord(fuel, i, j));
            }
            most = (i == 0) ? least : real_max(most, least);
        }
        const mpc_real begin_w = mpc_par.learned_power_w[k];
        of->slope[k] = most;
        of->intercept[k] = value - (most * begin_w);
        value += most * (mpc_par.learned_power_w[k + 1] - begin_w);
    }
    of->idle_g_per_s = of->intercept[0];
    of->chord_g_per_j = (value - of->idle_g_per_s) / mpc_par.engine_max_w;
}

int32_t mpc_learned_check(const mpc_state *state)
{
    const mpc_learned *const of = &state->learned;
    return within(of->one, REAL(0.0), SUM_MOST) & within(of->p, -SUM_MOST, SUM_MOST)
           & within(of->pp, REAL(0.0), SUM_MOST) & within(of->r, REAL(0.0), SUM_MOST)
           & within(of->rp, -SUM_MOST, SUM_MOST);
}
