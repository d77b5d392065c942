"""Closed loop: a controller drives a cycle on the plant, second by second."""

from collections.abc import Callable
from time import perf_counter

from qpmpc.controllers.base import Controller, Observation
from qpmpc.controllers.factory import ControllerSettings, make_controller
from qpmpc.cycles import Cycle
from qpmpc.preview.forecast import Trace
from qpmpc.results import Run, Trajectory
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.vehicle.plant import Plant

Progress = Callable[[int, int], None]
FRACTION_PARTS = 1000


def as_fraction(progress: Progress) -> Callable[[float], None]:
    """Turn a progress that counts parts into one that takes the finished fraction."""

    def report(fraction: float) -> None:
        progress(round(fraction * FRACTION_PARTS), FRACTION_PARTS)

    return report


def simulate(
    cycle: Cycle,
    controller: str | Controller,
    vehicle: Vehicle,
    *,
    settings: ControllerSettings | None = None,
    forecast: Trace | None = None,
    progress: Progress | None = None,
) -> Run:
    """Drive a cycle in closed loop on the nonlinear plant.

    Parameters
    ----------
    cycle : the true trip
    controller : a name, or a controller made for this very trip
    vehicle : plant parameters; the run starts at `vehicle.trip`
    settings : of the controllers, used with a name
    forecast : what the long horizon sees instead of the truth, used with a name
    progress : called as progress(steps done, steps in all)

    Raises
    ------
    InputError
        If the controller's name is unknown.
    """
    plant = Plant(vehicle)
    truth = Trace.of(cycle, vehicle)
    if isinstance(controller, str):
        controller = make_controller(controller, plant, truth, forecast, settings)
    steps = cycle.steps
    record = Trajectory.empty(steps)
    state = plant.initial_state()
    record.soc[0], record.t_cl_degc[0] = state.soc, state.t_cl_degc
    demand, speed = truth.demand_w.tolist(), truth.speed_mps.tolist()
    for t in range(steps):
        seen = Observation(t, state.soc, state.t_cl_degc, state.engine_on, demand[t], speed[t])
        start = perf_counter()
        decision = controller.decide(seen)
        record.step_time_s[t] = perf_counter() - start
        state, flows = plant.step(state, decision.command, demand[t], speed[t])
        record.store(t, state, flows, decision)
        if progress is not None:
            progress(t + 1, steps)
    record.demand_w[:], record.speed_mps[:] = truth.demand_w, truth.speed_mps
    return Run(
        cycle=cycle.name,
        controller=controller.name,
        solver=controller.solver_name,
        vehicle=vehicle,
        distance_km=cycle.distance_m / 1e3,
        trajectory=record,
    )
