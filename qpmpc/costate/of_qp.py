"""The certificate of `mh-qp`: the bound at the multipliers that its iteration leaves."""

import numpy as np
from numpy.typing import NDArray

from qpmpc.costate.certificate import Layout, choose, follow, violation_price_g
from qpmpc.costate.dual import Multipliers, StageCosts, with_signs
from qpmpc.costate.path import Shortest
from qpmpc.costate.program import ProgramBuilder
from qpmpc.preview.horizon import HorizonSettings
from qpmpc.preview.stages import Stages
from qpmpc.qp.linearisation import Linearisation
from qpmpc.qp.rows import Var
from qpmpc.qp.stage_qp import StageQp
from qpmpc.trip import Observation

Floats = NDArray[np.float64]

RUNS = 0.5  # share of a second from which on its engine runs
LEAST_SHARE = 1e-6  # below it there is no power while on


class QpCertificate:
    """Proven suboptimality of each QP's plan, with on or off in the seconds ahead.

    lambda comes from the multipliers of the SOC limits by its recursion: those of the SOC rows
    themselves have noise from stage to stage, which costs some grams.

    Parameters
    ----------
    qp : gives vehicle, curves, settings and rows
    horizon : layout of its stages
    """

    def __init__(self, qp: StageQp, horizon: HorizonSettings) -> None:
        self._programs = ProgramBuilder(qp.vehicle, qp.model, qp.stages, qp.settings, horizon)
        self._rows, self._horizon = qp.rows, horizon
        self._shortest = Shortest.of(qp.vehicle.engine)

    def multipliers(self, duals: Floats, slack_g_per_k: float) -> Multipliers:
        """Return those of the limits, with the right signs; duals of all rows, (n, rows)."""
        of_soc = -duals[:, self._rows.first("box_soc")]
        charge = np.cumsum(of_soc[::-1])[::-1]
        heat = -duals[:, self._rows.first("t_cl_min")] - duals[:, self._rows.first("t_cl_max")]
        return with_signs(Multipliers(charge, heat), slack_g_per_k)

    def of(
        self, stages: Stages, seen: Observation, about: Linearisation, x: Floats, duals: Floats
    ) -> float:
        """Return the plan's cost less the bound, g.

        Parameters
        ----------
        stages, seen, about : that the QP was made of
        x, duals : its solution in SI units, shape (n, variables) and (n, rows)
        """
        p = self._programs.at(stages, seen.soc, seen.t_cl_degc, about, seen.engine_on)
        at = self.multipliers(duals, p.slack_g_per_k)
        layout = Layout.of(stages, self._horizon, self._shortest, seen.engine_for_s)
        shared = StageCosts.of(p, at, p.shared)
        costs = shared.with_first(layout.short, StageCosts.of(p, at, p.curves))
        bound_g = choose(p, at, costs, layout).bound_g
        on = np.clip(x[:, Var.ON], 0.0, 1.0)
        share = np.clip((on - p.forced) / p.free, 0.0, 1.0)
        share[: layout.short] = on[: layout.short] >= RUNS
        share = np.where(p.must, 1.0, np.where(p.can, share, 0.0))
        # the battery gives as much in the seconds without a choice as in the others
        runs, more_w = np.maximum(on, LEAST_SHARE), p.forced_net_w - p.net_w
        power_w = (x[:, Var.P_ENG] - p.forced * more_w) / runs
        forced_w = np.clip(power_w + more_w, p.forced_low_w, p.forced_high_w)
        power_w = np.clip(power_w, p.low_w, p.high_w)
        price = violation_price_g(at)
        return follow(p, share, power_w, forced_w, layout.short, price).cost_g - bound_g
