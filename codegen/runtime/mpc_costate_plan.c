/* From the multipliers found to the plan of a second, and the proof of how good it is.
 *
 * The cost of the plan less the least of the Lagrangian, which is a bound on that of any plan. The
 * same in Python: qpmpc/costate/certificate.py.
 */
#include "mpc_constants.h"
#include "mpc_costate_parts.h"
#include "mpc_model.h"
#include "mpc_real.h"

/* Price of SOC below its limits that is above every multiplier of these, g per unit. */
static mpc_real violation_price_g(const mpc_state *state)
{
    mpc_real most = REAL(0.0);
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        most = real_max(state->stage[k].dual[state->search.here].charge, most);
    }
    return ABOVE_MULTIPLIERS * most;
}

/* Where the on-shares in x and the powers lead, in x, and what that costs. */
static mpc_real follow(mpc_state *state, mpc_real soc_price)
{
    mpc_real soc = REAL(0.0);
    mpc_real t_cl_k = REAL(0.0);
    mpc_real cost = REAL(0.0);
#if MPC_STARTS
    mpc_real before = (mpc_real)state->watch.good.engine_on;
#endif
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        mpc_stage *const stage = &state->stage[k];
        const mpc_stage_program *const of = &stage->p.of;
        const mpc_costate_dual *const dual = &stage->dual[state->search.here];
        const mpc_real share = stage->x[MPC_VAR_ON];
        const mpc_real free = stage->p.part[MPC_FREE].share;
        const mpc_real forced = stage->p.part[MPC_FORCED].share;
        const mpc_drive *const drive = dual->drive;
        const mpc_real chosen = free * share;
        const mpc_real off = (free - chosen) * stage->road.free_internal_off_w;
        const mpc_real fuel = (chosen * drive[MPC_FREE].fuel_g_per_s)
                              + (forced * drive[MPC_FORCED].fuel_g_per_s);
        const mpc_real power = (chosen * drive[MPC_FREE].power_w)
                               + (forced * drive[MPC_FORCED].power_w);
        const mpc_real internal = (chosen * drive[MPC_FREE].internal_w)
                                  + (forced * drive[MPC_FORCED].internal_w) + off;
        mpc_real heat = (of->per_fuel * fuel) - (of->per_power * power);
        mpc_real spent = of->charge_per_w * internal;
#if MPC_STARTS
        const mpc_real starts = real_max(stage->p.rises * (share - before), REAL(0.0));
        heat += of->start_k * starts;
        spent += mpc_par.cranking_soc * starts;
        cost += state->cal.start_fuel_g * starts;
        stage->x[MPC_VAR_START] = starts;
        before = share;
#endif
        soc = real_min(soc - spent, of->soc_high);
        t_cl_k = ((of->settled + heat) - (of->t_before * t_cl_k)) * stage->p.per_end;
        const mpc_real beyond_k = real_max(of->t_low - t_cl_k, REAL(0.0))
                                  + real_max(t_cl_k - of->t_high, REAL(0.0));
        cost += (of->fuel_cost * fuel) + (stage->p.price_t * t_cl_k);
        cost += state->cal.slack_g_per_k * beyond_k;
        cost += soc_price * real_max(of->soc_low - soc, REAL(0.0));
        stage->x[MPC_VAR_ON] = chosen + forced;
        stage->x[MPC_VAR_SOC] = soc;
        stage->x[MPC_VAR_T_CL] = t_cl_k;
        stage->x[MPC_VAR_P_ENG] = power;
        stage->x[MPC_VAR_FUEL] = state->cal.fuel_scale * fuel;
        stage->x[MPC_VAR_INTERNAL] = internal;
        stage->x[MPC_VAR_T_SLACK] = REAL(0.0);
        stage->y[MPC_ROW_CHARGE] = dual->charge;
        stage->y[MPC_ROW_HEAT] = dual->heat;
    }
    return cost;
}

int32_t mpc_method_finish(mpc_state *state, int32_t solved)
{
    /* the seconds ahead once more, on the true curves */
    for (int32_t k = 0; k < MPC_SHORT; k++) {
        mpc_costate_minimise_exactly(&state->stage[k], state->search.here);
    }
    const mpc_real bound = mpc_costate_choose(state) + state->search.constant_g[state->search.here];
    state->search.certificate_g = follow(state, violation_price_g(state)) - bound;
    return solved & mpc_iterate_usable(state);
}

/* What the rates of the coming second cost. */
static mpc_prices prices_now(const mpc_state *state)
{
    const mpc_stage_program *const of = &state->stage[0].p.of;
    const mpc_costate_dual *const dual = &state->stage[0].dual[state->search.here];
    const mpc_real fuel = of->fuel_cost - (dual->nu * of->per_fuel);
    const mpc_prices prices = {fuel / state->cal.fuel_scale, dual->nu * of->per_power,
                               dual->charge * of->charge_per_w};
    return prices;
}

/* On-shares are those of the smoothed dual, not of the path. Each second ahead at its own prices: it is
 * minimised already. */
mpc_real mpc_method_plan(const mpc_state *state, mpc_real *on_share, mpc_real *p_eng_w)
{
    mpc_going second[MPC_SHORT];
    for (int32_t k = 0; k < MPC_SHORT; k++) {
        const mpc_stage *const stage = &state->stage[k];
        const mpc_costate_dual *const dual = &stage->dual[state->search.here];
        const mpc_drive *const on = &dual->drive[MPC_FREE];
        on_share[k] = dual->share;
        p_eng_w[k] = dual->share * on->power_w;
        second[k].power_w = on->power_w;
        second[k].gain_w = stage->road.internal_off_w - on->internal_w;
        second[k].dearer = dual->on_g[MPC_FREE] - dual->off_g;
    }
    const mpc_prices prices = prices_now(state);
    const mpc_real room_w = mpc_full_battery_w(state, &prices);
    p_eng_w[0] = real_min(p_eng_w[0], on_share[0] * room_w);
    return mpc_coming_least_w(state, &prices, on_share, second, room_w);
}

void mpc_method_report(const mpc_state *state, mpc_out *out)
{
    out->certificate_g = state->search.certificate_g;
}

void mpc_plan(const mpc_state *state, mpc_real *x, mpc_real *duals)
{
    for (int32_t k = 0; k < MPC_STAGES; k++) {
        const mpc_stage *const stage = &state->stage[k];
        for (int32_t i = 0; i < MPC_VARS; i++) {
            x[(k * MPC_VARS) + i] = stage->x[i];
        }
        x[(k * MPC_VARS) + MPC_VAR_SOC] += state->origin_soc;
        x[(k * MPC_VARS) + MPC_VAR_T_CL] += state->origin_t_cl_degc;
        for (int32_t i = 0; i < MPC_ROWS; i++) {
            duals[(k * MPC_ROWS) + i] = stage->y[i];
        }
    }
}
