"""Closed loop: a controller drives a trip on the plant, second by second."""

import logging
from collections.abc import Callable
from dataclasses import replace
from time import perf_counter

import numpy as np

from qpmpc.controllers.base import Controller, Decision, Progress
from qpmpc.faults.inject import Injection
from qpmpc.faults.models import Faults
from qpmpc.foreign_plant import ForeignPlant
from qpmpc.results import Run
from qpmpc.trajectory import Trajectory
from qpmpc.trip import Observation, Trip

_log = logging.getLogger(__name__)
OnStep = Callable[[Observation, Decision], None]


def drive(
    trip: Trip,
    controller: Controller,
    *,
    faults: Faults | None = None,
    on_step: OnStep | None = None,
    progress: Progress | None = None,
    plant: ForeignPlant | None = None,
) -> Run:
    """Drive a trip in closed loop on the nonlinear plant.

    Parameters
    ----------
    trip : its cycle is the truth
    controller : made for this trip, and not used since
    faults : to be injected; what they do to the trip is found by `qpmpc.simulate`
    on_step : called as on_step(observation, decision) after each decision, before the plant moves;
        its time does not count as the controller's; observations are without faults
    progress : called as progress(steps done, steps in all); before that, if a controller takes
        long to depart, with the controller's own count
    plant : somebody else's, made for this run; that of the trip's vehicle if None

    Raises
    ------
    QpmpcError
        If the controller belongs to another trip or has driven already.
    InputError
        If a fault would begin after the arrival.
    """
    if faults:
        controller.check_ready(trip)
        injection = Injection(controller, faults)
        try:
            run = _drive(trip, controller, injection.decide, on_step, progress, plant)
            return replace(run, remarks=(*run.remarks, *injection.remarks))
        finally:
            injection.remove()
    return _drive(trip, controller, controller.decide, on_step, progress, plant)


def _drive(
    trip: Trip,
    controller: Controller,
    decide: Callable[[Observation], Decision],
    on_step: OnStep | None,
    progress: Progress | None,
    foreign: ForeignPlant | None,
) -> Run:
    _log.info("%s departs on %s, %d s", controller.name, trip.cycle.name, trip.steps)
    controller.begin(trip, progress)
    plant, steps = foreign or trip.plant, trip.steps
    record = Trajectory.empty(steps)
    state = plant.initial_state()
    record.soc[0], record.t_cl_degc[0] = state.soc, state.t_cl_degc
    report = progress if controller.decides_online else None
    for t in range(steps):
        seen = trip.observation(t, state)
        start = perf_counter()
        decision = decide(seen)
        record.step_time_s[t] = perf_counter() - start
        if decision.fallback:
            _log.debug("second %d: %s drives", t, decision.fallback)
        if on_step is not None:
            on_step(seen, decision)
        state, flows = plant.step(state, decision.command, seen.demand_w, seen.speed_mps)
        record.store(t, state, flows, decision)
        if report is not None:
            report(t + 1, steps)
    if not controller.decides_online:
        record.step_time_s[:] = np.nan
    _log.info(
        "%s arrives: fallbacks drove in %d of %d s",
        controller.name,
        sum(map(bool, record.fallback)),
        steps,
    )
    record.demand_w[:], record.speed_mps[:] = trip.truth.demand_w, trip.truth.speed_mps
    return Run(
        cycle=trip.cycle.name,
        controller=controller.name,
        solver=controller.solver_name,
        implementation=controller.implementation,
        remarks=(
            *trip.remarks,
            *controller.remarks,
            *_fallbacks(controller.name, record.fallback),
            *_of_plant(trip, controller, foreign),
        ),
        reservations=(
            *controller.reservations,
            *(() if foreign is None else foreign.reservations()),
        ),
        expects=controller.expects,
        soc_price_g=controller.soc_price_g,
        vehicle=trip.vehicle,
        distance_km=trip.cycle.distance_m / 1e3,
        trajectory=record,
        plant=None if foreign is None else foreign.account(),
    )


def _of_plant(trip: Trip, controller: Controller, plant: ForeignPlant | None) -> list[str]:
    said = () if plant is None else plant.remarks()
    return [f"{controller.name} on {trip.cycle.name}: {line}" for line in said]


def _fallbacks(name: str, rungs: list[str]) -> list[str]:
    """Say so where something other than the controller's own plan drove."""
    steps = [k for k, rung in enumerate(rungs) if rung]
    if not steps:
        return []
    what = " and ".join(sorted({rungs[k] for k in steps}))
    return [f"{name}: {what} drove in {len(steps)} of {len(rungs)} s, first at {steps[0]} s"]
