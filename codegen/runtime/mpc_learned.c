/* Idle and slope that the fuel map lacks by least squares, forgetful and bounded, from the fuel
 * measured.
 *
 * The same in Python, with the formulas: qpmpc/pwa/learned_fuel.py.
 */
#include "mpc_learned.h"

#include "mpc_constants.h"
#include "mpc_parts.h"
#include "mpc_real.h"

static int32_t is_count(int32_t x, int32_t most) { return ((x >= 0) && (x <= most)) ? 1 : 0; }

/* False for not a number. */
static int32_t is_sum(mpc_wide x)
{
    const mpc_wide most = (mpc_wide)SUM_MOST;
    return ((x >= -most) && (x <= most)) ? 1 : 0;
}

/* Idle, slope and what is late as they are now, by elimination from the last. `weight` is the map's
 * in the equation of each; no pivot is less, but by rounding. */
static void solve(const mpc_learned *of, mpc_wide x[MPC_UNKNOWNS])
{
    static const mpc_wide weight[MPC_UNKNOWNS] = {(mpc_wide)PRIOR_IDLE, (mpc_wide)PRIOR_SLOPE,
                                                  (mpc_wide)PRIOR_LATE, (mpc_wide)PRIOR_LATE,
                                                  (mpc_wide)PRIOR_LATE};
    mpc_wide a[MPC_UNKNOWNS][MPC_UNKNOWNS];
    for (int32_t i = 0; i < MPC_UNKNOWNS; i++) {
        for (int32_t j = 0; j < MPC_UNKNOWNS; j++) {
            a[i][j] = of->square[i][j];
        }
        a[i][i] += weight[i];
        x[i] = of->product[i];
    }
    for (int32_t k = MPC_UNKNOWNS - 1; k >= 0; k--) {
        a[k][k] = (a[k][k] > weight[k]) ? a[k][k] : weight[k];
        for (int32_t i = 0; i < k; i++) {
            const mpc_wide factor = a[i][k] / a[k][k];
            for (int32_t j = 0; j < k; j++) {
                a[i][j] -= factor * a[k][j];
            }
            x[i] -= factor * x[k];
        }
    }
    for (int32_t k = 0; k < MPC_UNKNOWNS; k++) {
        for (int32_t j = 0; j < k; j++) {
            x[k] -= a[k][j] * x[j];
        }
        x[k] /= a[k][k];
    }
}

/* Learn from a second in which so much more was measured than the map and a start take. */
static void learn(mpc_learned *of, mpc_wide more)
{
    mpc_wide found[MPC_UNKNOWNS];
    mpc_wide x[MPC_UNKNOWNS];
    solve(of, found);
    x[0] = (mpc_wide)of->cold[0];
    x[1] = (mpc_wide)of->load[0];
    for (int32_t j = 1; j <= MPC_LATE; j++) {
        const mpc_wide late = (mpc_wide)real_clip((mpc_real)found[1 + j], REAL(0.0), REAL(1.0));
        x[0] += late * ((mpc_wide)of->cold[j] - (mpc_wide)of->cold[j - 1]);
        x[1] += late * ((mpc_wide)of->load[j] - (mpc_wide)of->load[j - 1]);
        x[1 + j] = (mpc_wide)of->fuel[j] - (mpc_wide)of->fuel[j - 1];
    }
    const mpc_wide kept = (mpc_wide)KEPT;
    for (int32_t i = 0; i < MPC_UNKNOWNS; i++) {
        for (int32_t j = 0; j < MPC_UNKNOWNS; j++) {
            of->square[i][j] = (kept * of->square[i][j]) + (x[i] * x[j]);
        }
        of->product[i] = (kept * of->product[i]) + (more * x[i]);
    }
}

/* Put a second in front of those before. */
static void remember(mpc_learned *of, mpc_real fuel, mpc_real cold, mpc_real load)
{
    for (int32_t j = MPC_LATE; j > 0; j--) {
        of->fuel[j] = of->fuel[j - 1];
        of->cold[j] = of->cold[j - 1];
        of->load[j] = of->load[j - 1];
    }
    of->fuel[0] = fuel;
    of->cold[0] = cold;
    of->load[0] = load;
}

/* Forget the last seconds: no fuel of theirs can come. */
static void forget_seconds(mpc_learned *of)
{
    for (int32_t j = 0; j <= MPC_LATE; j++) {
        remember(of, REAL(0.0), REAL(0.0), REAL(0.0));
    }
}

/* Full power also stands for one that is not known, and teaches nothing while its fuel may come. */
void mpc_learned_take(mpc_state *state)
{
    const mpc_measured *const good = &state->watch.good;
    mpc_learned *const of = &state->learned;
    const int32_t is_on = (good->engine_on != 0) ? 1 : 0;
    if ((is_on != 0) || (of->left_s > 0)) {
        const mpc_real p_eng_w = good->p_eng_before_w;
        const mpc_real rated_g = mpc_par.learned_map_g_per_s[MPC_FUEL_PIECES];
        mpc_real cold = REAL(0.0);
        mpc_real share = REAL(0.0);
        mpc_real start = REAL(0.0);
        if (is_on != 0) {
            cold = mpc_map_cold_factor(good->t_cl_degc);
            share = (cold * mpc_map_fuel_g_per_s(p_eng_w)) / rated_g;
            start = (good->engine_for_s == 1) ? (state->cal.start_fuel_g / rated_g) : REAL(0.0);
        }
        of->left_s = (is_on != 0) ? MPC_LATE : (of->left_s - 1);
        if ((is_on != 0) && (p_eng_w >= mpc_par.engine_max_w)) {
            of->void_s = MPC_LATE + 1;
        } else {
            of->void_s = (of->void_s > 0) ? (of->void_s - 1) : 0;
        }
        remember(of, share + start, cold, cold * (p_eng_w / mpc_par.engine_max_w));
        mpc_real least = of->fuel[0];
        mpc_real most = of->fuel[0];
        for (int32_t j = 1; j <= MPC_LATE; j++) {
            least = real_min(least, of->fuel[j]);
            most = real_max(most, of->fuel[j]);
        }
        const mpc_real measured = good->fuel_g / rated_g; /* below 0 if it is not known */
        if ((of->void_s == 0) && (within(measured, RATIO_LEAST * least, RATIO_MOST * most) != 0)) {
            learn(of, ((mpc_wide)measured - (mpc_wide)start) - (mpc_wide)share);
        }
        if (of->left_s == 0) {
            forget_seconds(of);
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
    mpc_wide found[MPC_UNKNOWNS];
    solve(of, found);
    const mpc_real rated_g = mpc_par.learned_map_g_per_s[MPC_FUEL_PIECES];
    const mpc_real idle_least = real_max(-IDLE_MOST, -(mpc_par.learned_map_g_per_s[0] / rated_g));
    const mpc_real idle = real_clip((mpc_real)found[0], idle_least, IDLE_MOST);
    const mpc_real slope = real_clip((mpc_real)found[1], -SLOPE_MOST, SLOPE_MOST);
    mpc_real fuel[MPC_FUEL_PIECES + 1];
    for (int32_t k = 0; k <= MPC_FUEL_PIECES; k++) {
        const mpc_real more = idle + (slope * (mpc_par.learned_power_w[k] / mpc_par.engine_max_w));
        fuel[k] = mpc_par.learned_map_g_per_s[k] + (rated_g * more);
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
    int32_t fine = is_count(of->left_s, MPC_LATE) & is_count(of->void_s, MPC_LATE + 1);
    for (int32_t j = 0; j <= MPC_LATE; j++) {
        fine &= within(of->fuel[j], REAL(0.0), SUM_MOST) & within(of->cold[j], REAL(0.0), SUM_MOST)
                & within(of->load[j], REAL(0.0), SUM_MOST);
    }
    for (int32_t i = 0; i < MPC_UNKNOWNS; i++) {
        for (int32_t j = 0; j < MPC_UNKNOWNS; j++) {
            fine &= is_sum(of->square[i][j]);
        }
        fine &= is_sum(of->product[i]);
    }
    return fine;
}
