"""Baseline MPC, paper eqs. (6)-(8): a receding horizon of 1 s stages, SOC held by a penalty."""

from qpmpc.controllers.qp_planner import QpPlanner
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.trip import Trip


def baseline_mpc(trip: Trip, settings: ControllerSettings | None = None) -> QpPlanner:
    """Make the planner of the baseline MPC.

    min  sum_{k<H} mdot_k + lambda (SOC(t+H) - SOC_ref)^2,   paper eq. (6)

    over the same relaxed model, with the same solver, as `mh-qp`, so that only the horizon
    differs. Its preview is exact; the horizon ends with the trip.
    """
    settings = settings or ControllerSettings()
    of_qp = settings.baseline_mpc.as_mh_qp()
    return QpPlanner(trip.with_forecast(None), settings, of_qp, name="baseline-mpc")
