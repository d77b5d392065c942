/* The solver: operator splitting (ADMM) with a fixed number of iterations, the algorithm of OSQP
 * (Stellato, Banjac, Goulart, Bemporad, Boyd 2020) with a constant step size.
 *
 * min 1/2 x'Px + q'x  s.t.  low <= Ax <= high. Each iteration solves, with R = diag(rho),
 *
 *     (P + sigma I + A'RA) t = sigma x - q + A'(Rz - y)
 *     r <- a At + (1 - a) z,  x <- a t + (1 - a) x
 *     z <- clip(r + y / rho, low, high),  y <- y + rho (r - z)
 *
 * OSQP solves the same equations as a larger, indefinite system by a general sparse method. Here
 * the stages couple only through SOC and coolant temperature, so the matrix is block tridiagonal
 * and is factorised stage by stage: L D L' with seven variables a stage, in the order in which
 * they stand in `x`, which leaves few entries.
 */
#include <stddef.h>

#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"

#define UNLIMITED REAL(1.0e30)

/* What stands before the first stage. */
static const real_t nothing[MPC_VARS] = {REAL(0.0), REAL(0.0), REAL(0.0), REAL(0.0),
                                         REAL(0.0), REAL(0.0), REAL(0.0)};

/* Indices within the dense part of a factor. */
enum { IN_INTERNAL = 0, IN_FUEL = 1, IN_P_ENG = 2, IN_SOC = 3, IN_T_CL = 4 };

/* value = Ax, row by row */
static void multiply(const mpc_stage *stage, const real_t *x, const real_t *before, real_t *value)
{
    const stage_matrix *const a = &stage->a;
    value[ROW_SOC] = (a->soc[0] * x[VAR_SOC]) + (a->soc[1] * before[VAR_SOC])
                     + (a->soc[2] * x[VAR_INTERNAL]);
    value[ROW_T_CL] = (a->t_cl[0] * x[VAR_T_CL]) + (a->t_cl[1] * before[VAR_T_CL])
                      + (a->t_cl[2] * x[VAR_P_ENG]) + (a->t_cl[3] * x[VAR_FUEL]);
    for (int32_t i = 0; i < MPC_FUEL_PIECES; i++) {
        value[ROW_FUEL + i] = (a->fuel[i][0] * x[VAR_FUEL]) + (a->fuel[i][1] * x[VAR_P_ENG])
                              + (a->fuel[i][2] * x[VAR_ON]);
    }
    for (int32_t j = 0; j < MPC_BATTERY_PIECES; j++) {
        value[ROW_BATTERY + j] = (a->battery[j][0] * x[VAR_INTERNAL])
                                 + (a->battery[j][1] * x[VAR_P_ENG])
                                 + (a->battery[j][2] * x[VAR_ON]);
    }
    value[ROW_P_MAX] = (a->p_max[0] * x[VAR_P_ENG]) + (a->p_max[1] * x[VAR_ON]);
    value[ROW_P_MIN] = (a->p_min[0] * x[VAR_P_ENG]) + (a->p_min[1] * x[VAR_ON]);
    value[ROW_BOX_SOC] = x[VAR_SOC];
    value[ROW_BOX_ON] = x[VAR_ON];
    value[ROW_T_MIN] = (a->t_min[0] * x[VAR_T_CL]) + (a->t_min[1] * x[VAR_SLACK]);
    value[ROW_T_MAX] = (a->t_max[0] * x[VAR_T_CL]) + (a->t_max[1] * x[VAR_SLACK]);
    value[ROW_SLACK] = x[VAR_SLACK];
}

/* Entries of the matrix in the rows of slack and on, and the lower triangle of the others. */
typedef struct {
    real_t slack;
    real_t slack_t;
    real_t on;
    real_t on_internal;
    real_t on_fuel;
    real_t on_p_eng;
    real_t dense[COUPLED_COUNT][COUPLED_COUNT];
} stage_normal;

/* P + sigma I + A'RA of one stage, its rows alone. */
static void assemble(const mpc_stage *stage, stage_normal *m)
{
    const stage_matrix *const a = &stage->a;
    const real_t rho = mpc_par.rho;
    real_t on_on = REAL(1.0) + (a->p_max[1] * a->p_max[1]) + (a->p_min[1] * a->p_min[1]);
    real_t on_e = (a->p_max[0] * a->p_max[1]) + (a->p_min[0] * a->p_min[1]);
    real_t e_e = (a->p_max[0] * a->p_max[0]) + (a->p_min[0] * a->p_min[0]);
    real_t f_f = REAL(0.0);
    real_t f_e = REAL(0.0);
    real_t on_f = REAL(0.0);
    real_t on_g = REAL(0.0);
    real_t g_g = REAL(0.0);
    real_t g_e = REAL(0.0);
    for (int32_t i = 0; i < MPC_FUEL_PIECES; i++) {
        const real_t *const entry = a->fuel[i];
        f_f += entry[0] * entry[0];
        f_e += entry[0] * entry[1];
        e_e += entry[1] * entry[1];
        on_f += entry[0] * entry[2];
        on_e += entry[1] * entry[2];
        on_on += entry[2] * entry[2];
    }
    for (int32_t j = 0; j < MPC_BATTERY_PIECES; j++) {
        const real_t *const entry = a->battery[j];
        g_g += entry[0] * entry[0];
        g_e += entry[0] * entry[1];
        e_e += entry[1] * entry[1];
        on_g += entry[0] * entry[2];
        on_e += entry[1] * entry[2];
        on_on += entry[2] * entry[2];
    }
    const real_t strong = mpc_par.rho_equality;
    const real_t *const p = stage->hessian;
    m->slack = p[VAR_SLACK] + mpc_par.sigma
               + (rho * (REAL(1.0) + (a->t_min[1] * a->t_min[1]) + (a->t_max[1] * a->t_max[1])));
    m->slack_t = rho * ((a->t_min[0] * a->t_min[1]) + (a->t_max[0] * a->t_max[1]));
    m->on = p[VAR_ON] + mpc_par.sigma + (rho * on_on);
    m->on_internal = rho * on_g;
    m->on_fuel = rho * on_f;
    m->on_p_eng = rho * on_e;
    m->dense[IN_INTERNAL][IN_INTERNAL] = p[VAR_INTERNAL] + mpc_par.sigma + (rho * g_g)
                                         + (strong * a->soc[2] * a->soc[2]);
    m->dense[IN_FUEL][IN_INTERNAL] = REAL(0.0);
    m->dense[IN_FUEL][IN_FUEL] = p[VAR_FUEL] + mpc_par.sigma + (rho * f_f)
                                 + (strong * a->t_cl[3] * a->t_cl[3]);
    m->dense[IN_P_ENG][IN_INTERNAL] = rho * g_e;
    m->dense[IN_P_ENG][IN_FUEL] = (rho * f_e) + (strong * a->t_cl[3] * a->t_cl[2]);
    m->dense[IN_P_ENG][IN_P_ENG] = p[VAR_P_ENG] + mpc_par.sigma + (rho * e_e)
                                   + (strong * a->t_cl[2] * a->t_cl[2]);
    m->dense[IN_SOC][IN_INTERNAL] = strong * a->soc[2] * a->soc[0];
    m->dense[IN_SOC][IN_FUEL] = REAL(0.0);
    m->dense[IN_SOC][IN_P_ENG] = REAL(0.0);
    m->dense[IN_SOC][IN_SOC] =
        p[VAR_SOC] + mpc_par.sigma + rho + (strong * a->soc[0] * a->soc[0]);
    m->dense[IN_T_CL][IN_INTERNAL] = REAL(0.0);
    m->dense[IN_T_CL][IN_FUEL] = strong * a->t_cl[3] * a->t_cl[0];
    m->dense[IN_T_CL][IN_P_ENG] = strong * a->t_cl[2] * a->t_cl[0];
    m->dense[IN_T_CL][IN_SOC] = REAL(0.0);
    m->dense[IN_T_CL][IN_T_CL] =
        p[VAR_T_CL] + mpc_par.sigma
        + (rho * ((a->t_min[0] * a->t_min[0]) + (a->t_max[0] * a->t_max[0])))
        + (strong * a->t_cl[0] * a->t_cl[0]);
}

/* Eliminate SOC and T_cl of the stage before from this one. */
static void eliminate_before(mpc_stage *stage, const stage_factor *before, stage_normal *m)
{
    const stage_matrix *const a = &stage->a;
    const real_t strong = mpc_par.rho_equality * a->soc[1];
    const real_t heat = mpc_par.rho_equality * a->t_cl[1];
    const real_t t_soc = before->dense[IN_T_CL][IN_SOC];
    const real_t raw_soc[2] = {strong * a->soc[2], strong * a->soc[0]}; /* internal, soc */
    const real_t raw_t[COUPLED_COUNT] = {-raw_soc[0] * t_soc, heat * a->t_cl[3],
                                         heat * a->t_cl[2], -raw_soc[1] * t_soc,
                                         heat * a->t_cl[0]};
    stage_factor *const f = &stage->factor;
    f->before_soc[0] = raw_soc[0] * before->inverse_d[VAR_SOC];
    f->before_soc[1] = raw_soc[1] * before->inverse_d[VAR_SOC];
    m->dense[IN_INTERNAL][IN_INTERNAL] -= f->before_soc[0] * raw_soc[0];
    m->dense[IN_SOC][IN_INTERNAL] -= f->before_soc[1] * raw_soc[0];
    m->dense[IN_SOC][IN_SOC] -= f->before_soc[1] * raw_soc[1];
    for (int32_t i = 0; i < COUPLED_COUNT; i++) {
        f->before_t[i] = raw_t[i] * before->inverse_d[VAR_T_CL];
        for (int32_t j = 0; j <= i; j++) {
            m->dense[i][j] -= f->before_t[i] * raw_t[j];
        }
    }
}

/* L D L' of one stage. */
static void factorise_stage(mpc_stage *stage, stage_normal *m)
{
    stage_factor *const f = &stage->factor;
    f->inverse_d[VAR_SLACK] = REAL(1.0) / m->slack;
    f->slack_t = m->slack_t * f->inverse_d[VAR_SLACK];
    m->dense[IN_T_CL][IN_T_CL] -= f->slack_t * m->slack_t;
    const real_t on[3] = {m->on_internal, m->on_fuel, m->on_p_eng};
    f->inverse_d[VAR_ON] = REAL(1.0) / m->on;
    for (int32_t i = 0; i < 3; i++) {
        f->on[i] = on[i] * f->inverse_d[VAR_ON];
        for (int32_t j = 0; j <= i; j++) {
            m->dense[i][j] -= f->on[i] * on[j];
        }
    }
    for (int32_t c = 0; c < COUPLED_COUNT; c++) {
        const real_t inverse = REAL(1.0) / m->dense[c][c];
        f->inverse_d[COUPLED + c] = inverse;
        for (int32_t i = c + 1; i < COUPLED_COUNT; i++) {
            f->dense[i][c] = m->dense[i][c] * inverse;
            for (int32_t j = c + 1; j <= i; j++) {
                m->dense[i][j] -= f->dense[i][c] * m->dense[j][c];
            }
        }
    }
}

/* All memory of this solver is in the state: there is nothing to claim. */
void solver_claim(const mpc_state *state) { (void)state; }

void solver_start(mpc_state *state)
{
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        mpc_stage *const stage = &state->stage[k];
        multiply(stage, stage->x, (k > 0) ? state->stage[k - 1].x : nothing, stage->z);
        stage_normal m;
        assemble(stage, &m);
        if (k < (MPC_STAGES - 1)) {
            const stage_matrix *const next = &state->stage[k + 1].a;
            m.dense[IN_SOC][IN_SOC] += mpc_par.rho_equality * next->soc[1] * next->soc[1];
            m.dense[IN_T_CL][IN_T_CL] += mpc_par.rho_equality * next->t_cl[1] * next->t_cl[1];
        }
        if (k > 0) {
            eliminate_before(stage, &state->stage[k - 1].factor, &m);
        }
        factorise_stage(stage, &m);
    }
}

/* work = sigma x - q + A'(Rz - y), rows of this stage; what they add to the stage before too */
static void right_hand_side(mpc_stage *stage, real_t *work_before)
{
    const stage_matrix *const a = &stage->a;
    const real_t rho = mpc_par.rho;
    const real_t *const z = stage->z;
    const real_t *const y = stage->y;
    const real_t soc = (mpc_par.rho_equality * z[ROW_SOC]) - y[ROW_SOC];
    const real_t t_cl = (mpc_par.rho_equality * z[ROW_T_CL]) - y[ROW_T_CL];
    const real_t p_max = (rho * z[ROW_P_MAX]) - y[ROW_P_MAX];
    const real_t p_min = (rho * z[ROW_P_MIN]) - y[ROW_P_MIN];
    const real_t t_min = (rho * z[ROW_T_MIN]) - y[ROW_T_MIN];
    const real_t t_max = (rho * z[ROW_T_MAX]) - y[ROW_T_MAX];
    real_t internal = a->soc[2] * soc;
    real_t fuel = a->t_cl[3] * t_cl;
    real_t p_eng = (a->t_cl[2] * t_cl) + (a->p_max[0] * p_max) + (a->p_min[0] * p_min);
    real_t on = (a->p_max[1] * p_max) + (a->p_min[1] * p_min)
                + ((rho * z[ROW_BOX_ON]) - y[ROW_BOX_ON]);
    for (int32_t i = 0; i < MPC_FUEL_PIECES; i++) {
        const real_t w = (rho * z[ROW_FUEL + i]) - y[ROW_FUEL + i];
        fuel += a->fuel[i][0] * w;
        p_eng += a->fuel[i][1] * w;
        on += a->fuel[i][2] * w;
    }
    for (int32_t j = 0; j < MPC_BATTERY_PIECES; j++) {
        const real_t w = (rho * z[ROW_BATTERY + j]) - y[ROW_BATTERY + j];
        internal += a->battery[j][0] * w;
        p_eng += a->battery[j][1] * w;
        on += a->battery[j][2] * w;
    }
    real_t *const work = stage->work;
    for (int32_t i = 0; i < MPC_VARS; i++) {
        work[i] = (mpc_par.sigma * stage->x[i]) - stage->q[i];
    }
    work[VAR_SLACK] += (a->t_min[1] * t_min) + (a->t_max[1] * t_max)
                       + ((rho * z[ROW_SLACK]) - y[ROW_SLACK]);
    work[VAR_ON] += on;
    work[VAR_INTERNAL] += internal;
    work[VAR_FUEL] += fuel;
    work[VAR_P_ENG] += p_eng;
    work[VAR_SOC] += (a->soc[0] * soc) + ((rho * z[ROW_BOX_SOC]) - y[ROW_BOX_SOC]);
    work[VAR_T_CL] += (a->t_cl[0] * t_cl) + (a->t_min[0] * t_min) + (a->t_max[0] * t_max);
    work_before[VAR_SOC] += a->soc[1] * soc;
    work_before[VAR_T_CL] += a->t_cl[1] * t_cl;
}

/* work <- D^-1 L^-1 work, rows of this stage; of the stage before, L^-1 work is needed */
static void substitute_forward(mpc_stage *stage, real_t *soc, real_t *t_cl)
{
    const stage_factor *const f = &stage->factor;
    real_t *const b = &stage->work[COUPLED];
    const real_t slack = stage->work[VAR_SLACK];
    const real_t on = stage->work[VAR_ON];
    b[IN_INTERNAL] -= (f->before_soc[0] * *soc) + (f->before_t[IN_INTERNAL] * *t_cl)
                      + (f->on[0] * on);
    b[IN_FUEL] -= (f->before_t[IN_FUEL] * *t_cl) + (f->on[1] * on);
    b[IN_P_ENG] -= (f->before_t[IN_P_ENG] * *t_cl) + (f->on[2] * on);
    b[IN_SOC] -= (f->before_soc[1] * *soc) + (f->before_t[IN_SOC] * *t_cl);
    b[IN_T_CL] -= (f->before_t[IN_T_CL] * *t_cl) + (f->slack_t * slack);
    for (int32_t i = 1; i < COUPLED_COUNT; i++) {
        for (int32_t j = 0; j < i; j++) {
            b[i] -= f->dense[i][j] * b[j];
        }
    }
    *soc = b[IN_SOC];
    *t_cl = b[IN_T_CL];
    for (int32_t i = 0; i < MPC_VARS; i++) {
        stage->work[i] *= f->inverse_d[i];
    }
}

/* work <- L^-T work, once the stage after is done */
static void substitute_backward(mpc_stage *stage, const mpc_stage *after)
{
    const stage_factor *const f = &stage->factor;
    real_t *const b = &stage->work[COUPLED];
    if (after != NULL) {
        const stage_factor *const g = &after->factor;
        const real_t *const next = &after->work[COUPLED];
        b[IN_SOC] -= (g->before_soc[0] * next[IN_INTERNAL]) + (g->before_soc[1] * next[IN_SOC]);
        for (int32_t i = 0; i < COUPLED_COUNT; i++) {
            b[IN_T_CL] -= g->before_t[i] * next[i];
        }
    }
    for (int32_t i = COUPLED_COUNT - 2; i >= 0; i--) {
        for (int32_t j = i + 1; j < COUPLED_COUNT; j++) {
            b[i] -= f->dense[j][i] * b[j];
        }
    }
    stage->work[VAR_ON] -= (f->on[0] * b[IN_INTERNAL]) + (f->on[1] * b[IN_FUEL])
                           + (f->on[2] * b[IN_P_ENG]);
    stage->work[VAR_SLACK] -= f->slack_t * b[IN_T_CL];
}

/* Last line of the iteration for one row: r + y / rho is clipped to [low, high]. */
static inline void project(real_t product, real_t low, real_t high, real_t *z, real_t *y)
{
    const real_t relaxed =
        (mpc_par.relaxation * product) + ((REAL(1.0) - mpc_par.relaxation) * *z);
    const real_t inside = real_clip(relaxed + (mpc_par.inverse_rho * *y), low, high);
    *y += mpc_par.rho * (relaxed - inside);
    *z = inside;
}

/* The same for an equality. */
static inline void project_onto(real_t product, real_t value, real_t *z, real_t *y)
{
    const real_t relaxed =
        (mpc_par.relaxation * product) + ((REAL(1.0) - mpc_par.relaxation) * *z);
    *y += mpc_par.rho_equality * (relaxed - value);
    *z = value;
}

/* The second and third line of the iteration for one stage. */
static void update(mpc_stage *stage, const real_t *before)
{
    const stage_bounds *const b = &stage->b;
    real_t *const z = stage->z;
    real_t *const y = stage->y;
    real_t product[MPC_ROWS];
    multiply(stage, stage->work, before, product);
    for (int32_t i = 0; i < MPC_VARS; i++) {
        stage->x[i] = (mpc_par.relaxation * stage->work[i])
                      + ((REAL(1.0) - mpc_par.relaxation) * stage->x[i]);
    }
    project_onto(product[ROW_SOC], REAL(0.0), &z[ROW_SOC], &y[ROW_SOC]);
    project_onto(product[ROW_T_CL], b->t_cl, &z[ROW_T_CL], &y[ROW_T_CL]);
    for (int32_t i = ROW_FUEL; i < ROW_BATTERY; i++) {
        project(product[i], REAL(0.0), UNLIMITED, &z[i], &y[i]);
    }
    for (int32_t i = ROW_BATTERY; i < ROW_P_MAX; i++) {
        project(product[i], b->battery_low[i - ROW_BATTERY], UNLIMITED, &z[i], &y[i]);
    }
    project(product[ROW_P_MAX], -UNLIMITED, REAL(0.0), &z[ROW_P_MAX], &y[ROW_P_MAX]);
    project(product[ROW_P_MIN], b->p_min_low, UNLIMITED, &z[ROW_P_MIN], &y[ROW_P_MIN]);
    project(product[ROW_BOX_SOC], b->soc_low, b->soc_high, &z[ROW_BOX_SOC], &y[ROW_BOX_SOC]);
    project(product[ROW_BOX_ON], b->on_low, b->on_high, &z[ROW_BOX_ON], &y[ROW_BOX_ON]);
    project(product[ROW_T_MIN], b->t_min_low, UNLIMITED, &z[ROW_T_MIN], &y[ROW_T_MIN]);
    project(product[ROW_T_MAX], -UNLIMITED, b->t_max_high, &z[ROW_T_MAX], &y[ROW_T_MAX]);
    project(product[ROW_SLACK], REAL(0.0), UNLIMITED, &z[ROW_SLACK], &y[ROW_SLACK]);
}

int32_t solver_iterate(mpc_state *state, int32_t count)
{
    real_t unused[MPC_VARS] = {REAL(0.0), REAL(0.0), REAL(0.0), REAL(0.0),
                               REAL(0.0), REAL(0.0), REAL(0.0)};
    for (int32_t n = 0; n < count; n++) {
        for (int32_t k = 0; k < MPC_STAGES; k++) {
            right_hand_side(&state->stage[k], (k > 0) ? state->stage[k - 1].work : unused);
        }
        real_t soc = REAL(0.0);
        real_t t_cl = REAL(0.0);
        for (int32_t k = 0; k < MPC_STAGES; k++) {
            substitute_forward(&state->stage[k], &soc, &t_cl);
        }
        for (int32_t k = MPC_STAGES - 1; k >= 0; k--) {
            substitute_backward(&state->stage[k], (k < (MPC_STAGES - 1)) ? &state->stage[k + 1] : NULL);
        }
        for (int32_t k = 0; k < MPC_STAGES; k++) {
            update(&state->stage[k], (k > 0) ? state->stage[k - 1].work : nothing);
        }
    }
    return 1;
}
