/* Last rung of the ladder: load levelling by rules, plus engine on for heat. No preview. */
#include "mpc_model.h"
#include "mpc_parts.h"
#include "mpc_real.h"
#include "mpc_must_run.h"

mpc_command mpc_rules_decide(mpc_rule_memory *memory, const mpc_measured *seen,
                             const mpc_calibration *cal)
{
    const mpc_real net_w = seen->demand_w + mpc_par.aux_power_w;
    const mpc_real requested_w = net_w + (cal->rule_k_soc_w * (cal->rule_soc_ref - seen->soc));
    const int32_t too_short = (seen->engine_for_s < mpc_par.rule_min_on_s) ? 1 : 0;
    const int32_t is_held = seen->engine_on & too_short;
    if ((requested_w > cal->rule_on_w) || (seen->soc < cal->rule_soc_forced)
        || (must_run(net_w, seen->speed_mps) != 0)) {
        memory->power_request = 1;
    } else if ((requested_w < cal->rule_off_w) && (is_held == 0)) {
        memory->power_request = 0;
    } else {
        /* between the thresholds: as before */
    }
    if (seen->t_cl_degc < cal->rule_heat_on_degc) {
        memory->heat_request = 1;
    } else if (seen->t_cl_degc > cal->rule_heat_off_degc) {
        memory->heat_request = 0;
    } else {
        /* between the thresholds: as before */
    }
    mpc_command wish = {REAL(0.0), 0};
    if (memory->power_request != 0) {
        wish.engine_on = 1;
        wish.p_eng_w = real_max(requested_w, cal->rule_power_min_w);
    } else if ((memory->heat_request != 0) || (is_held != 0)) {
        wish.engine_on = 1;
        wish.p_eng_w = cal->rule_heat_power_w;
    } else {
        /* engine off */
    }
    return wish;
}
