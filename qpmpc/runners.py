"""Everything that can drive a cycle, by name: causal controllers and plans for a whole trip."""

from collections.abc import Callable, Sequence
from importlib.util import find_spec

import numpy as np

from qpmpc.controllers.factory import ControllerSettings, controller_names
from qpmpc.controllers.replay import Replay
from qpmpc.cycles import Cycle
from qpmpc.errors import InputError
from qpmpc.results import Run
from qpmpc.simulate import Progress, as_fraction, simulate
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.vehicle.plant import Command

Planner = Callable[[Cycle, Vehicle, ControllerSettings, Progress | None], list[Command]]


def _dp(
    cycle: Cycle, vehicle: Vehicle, settings: ControllerSettings, progress: Progress | None
) -> list[Command]:
    from qpmpc.verification.dynamic_programming import solve_dp

    report = None if progress is None else as_fraction(progress)
    plan = solve_dp(cycle, vehicle, settings.dp, report)
    pairs = zip(plan.engine_on.tolist(), plan.p_eng_w.tolist(), strict=True)
    return [Command(on, p_eng_w) for on, p_eng_w in pairs]


# Methods that know the whole trip: they plan all commands at once.
_PLANNERS: dict[str, Planner] = {"dp": _dp}

# What some names need beyond the core: module to look for, extra that brings it.
_NEEDS = {"dp": ("numba", "verification"), "mh-nlp": ("casadi", "verification")}


def run_names() -> tuple[str, ...]:
    """Return all names that `run` knows, the default controller first."""
    return (*controller_names(), *_PLANNERS)


def check_names(names: Sequence[str]) -> None:
    """Check that each name can be run here, before any time is spent.

    Raises
    ------
    InputError
        If a name is unknown or named twice, or a package that it needs is not installed.
    """
    for i, name in enumerate(names):
        if name not in run_names():
            raise InputError(f"unknown controller {name!r}: use one of {', '.join(run_names())}")
        if name in names[:i]:
            raise InputError(f"controller {name!r} is named twice")
        module, extra = _NEEDS.get(name, ("", ""))
        if module and find_spec(module) is None:
            raise InputError(
                f"controller {name!r} needs {module}: pip install 'qpmpc-iptm[{extra}]'"
            )


def run(
    cycle: Cycle,
    name: str,
    vehicle: Vehicle,
    settings: ControllerSettings | None = None,
    progress: Progress | None = None,
) -> Run:
    """Drive a cycle on the plant.

    A plan for the whole trip is replayed on the same plant as any controller. Its step times are
    nan, because it decides nothing from step to step.

    Parameters
    ----------
    cycle : what is driven
    name : one of `run_names`
    vehicle : the plant
    settings : of all controllers
    progress : called as progress(done, in all)

    Raises
    ------
    InputError
        See `check_names`, and those of the method itself.
    """
    check_names([name])
    settings = settings or ControllerSettings()
    planner = _PLANNERS.get(name)
    if planner is None:
        return simulate(cycle, name, vehicle, settings=settings, progress=progress)
    commands = planner(cycle, vehicle, settings, progress)
    finished = simulate(cycle, Replay(name, commands), vehicle)
    finished.trajectory.step_time_s[:] = np.nan
    return finished
