"""The convex model of a whole trip: one relaxed QP at 1 Hz, linearised to convergence.

Unlike `lower_bound` this is not a proof: alpha(T) F is expanded about the solution itself and the
battery has the resistance of its initial SOC. It shows the fuel of the convex model, and how near
to on or off the relaxed engine is when nothing is averaged.
"""

from dataclasses import dataclass

import numpy as np

from qpmpc.cycles import Cycle
from qpmpc.errors import QpmpcError
from qpmpc.preview import HorizonSettings, StageBuilder, Trace
from qpmpc.pwa import PwaModel
from qpmpc.pwa.model import PwaTolerances
from qpmpc.qp import Linearisation, QpSettings, ScalingSettings, StageQp, Var
from qpmpc.solvers.names import make_solver
from qpmpc.vehicle.parameters import Vehicle

TOLERANCES = PwaTolerances(
    fuel_g_per_s=2e-4, fuel_knee_w=20e3, battery_w=2.0, battery_share=0.001, alpha=1e-4
)
SETTINGS = QpSettings(
    terminal_low=1.0, soc_reserve=0.0, t_cl_margin_k=0.0, slack_g_per_k=100.0, regularisation=1e-9
)
CONVERGED_G, MOST_ROUNDS = 1e-3, 12
INTEGRAL = 0.02


@dataclass(frozen=True)
class RelaxedTrip:
    """Solution of the relaxed trip.

    Attributes
    ----------
    fuel_g : sum h alpha(T) F, and the fuel of starts
    integral_share : share of seconds whose on-share is within 0.02 of 0 or 1
    rounds : linearisations until the fuel converged
    """

    fuel_g: float
    integral_share: float
    rounds: int


def relaxed_trip(cycle: Cycle, vehicle: Vehicle) -> RelaxedTrip:
    """Solve the trip with under-estimators of the fuel and battery curves.

    Raises
    ------
    QpmpcError
        If the solver fails or the linearisation does not converge.
    """
    truth = Trace.of(cycle, vehicle)
    layout = HorizonSettings(short_stages=cycle.steps, blocks=0, block_s=0)
    preview = StageBuilder(vehicle, truth, truth, layout)
    fit = PwaModel.of(vehicle, TOLERANCES)
    under = PwaModel(
        fit.fuel.under_estimator(),
        fit.battery.under_estimator(),
        fit.alpha.under_estimator(),
        fit.battery_energy_j,
        fit.line,
    )
    qp = StageQp(vehicle, under, preview.count, SETTINGS, ScalingSettings())
    stages, start = preview.at(0), vehicle.trip.t_cl_init_degc
    about = Linearisation.constant(preview.count, start)
    solver = make_solver("piqp", 1e-7)
    fuel_g = np.inf
    for done in range(MOST_ROUNDS):
        data = qp.update(stages, vehicle.trip.soc_init, start, about)
        if done == 0:
            solver.setup(qp.structure, data)
        solution = solver.solve(data, None, None, cold=True)
        if not solution.usable:
            raise QpmpcError(f"relaxed trip {cycle.name}: {solution.status.value}")
        x = data.scaling.primal(solution.primal).reshape(preview.count, -1)
        ends = x[:, Var.T_CL]
        mean = 0.5 * (ends + np.concatenate([[start], ends[:-1]]))
        last, fuel_g = fuel_g, float(np.sum(stages.duration_s * under.alpha(mean) * x[:, Var.FUEL]))
        if qp.table.start_fuel:
            fuel_g += vehicle.engine.start_fuel_g * float(x[:, Var.START].sum())
        if abs(fuel_g - last) < CONVERGED_G:
            on = x[:, Var.ON]
            integral = float(np.mean((on < INTEGRAL) | (on > 1.0 - INTEGRAL)))
            return RelaxedTrip(fuel_g, integral, done + 1)
        about = Linearisation.about(x, start, layout)
    raise QpmpcError(f"relaxed trip {cycle.name}: no convergence in {MOST_ROUNDS} linearisations")
