"""Which implementation runs a controller on this machine: generated C, or Python."""

import logging
from collections.abc import Callable

from qpmpc.codegen.c_compiler import CodegenError, required_compiler
from qpmpc.codegen.controller import GeneratedController
from qpmpc.codegen.costate_controller import GeneratedCostate
from qpmpc.controllers.base import Controller
from qpmpc.controllers.mh_costate import MhCostate, MhCostateSettings
from qpmpc.controllers.qp_planner import QpPlanner
from qpmpc.controllers.receding_horizon import RecedingHorizon
from qpmpc.controllers.settings import ControllerSettings, MhQpSettings
from qpmpc.errors import InputError
from qpmpc.remarks import say_once
from qpmpc.trip import Trip

_log = logging.getLogger(__name__)
SLOWER = "steps take several times longer ({section}.implementation=python says that this is meant)"


def mh_qp(trip: Trip, settings: ControllerSettings | None = None) -> Controller:
    """Make `mh-qp` in the implementation that is set."""
    settings = settings or ControllerSettings()
    return _made_qp("mh-qp", trip, settings, settings.mh_qp)


def mh_qp_paper(trip: Trip, settings: ControllerSettings | None = None) -> Controller:
    """Make `mh-qp-paper`: the paper's grid and averaged preview."""
    settings = settings or ControllerSettings()
    return _made_qp("mh-qp-paper", trip, settings, settings.mh_qp_paper)


def mh_costate(trip: Trip, settings: ControllerSettings | None = None) -> Controller:
    """Make `mh-costate` in the implementation that is set."""
    settings = settings or ControllerSettings()
    own = settings.of("mh_costate", MhCostateSettings())
    return _made(
        MhCostate.name,
        own.implementation,
        lambda: GeneratedCostate(trip, settings),
        lambda: RecedingHorizon(trip, MhCostate(trip, settings)),
    )


def _made_qp(
    name: str, trip: Trip, settings: ControllerSettings, of_qp: MhQpSettings
) -> Controller:
    return _made(
        name,
        of_qp.implementation,
        lambda: GeneratedController(trip, settings, of_qp, name=name),
        lambda: RecedingHorizon(trip, QpPlanner(trip, settings, of_qp, name=name)),
    )


def _made(
    name: str,
    implementation: str,
    in_c: Callable[[], Controller],
    in_python: Callable[[], Controller],
) -> Controller:
    """Make a controller in C or Python; a fallback of `auto` is reported with its reason.

    Raises
    ------
    InputError, CodegenError
        If C is set and not available.
    """
    reason, slower = "", SLOWER.format(section=name.replace("-", "_"))
    if implementation != "python":
        try:
            if implementation == "auto":
                required_compiler()
            made = in_c()
            _log.info("%s runs as compiled C", name)
            return made
        except (InputError, CodegenError) as error:
            if implementation == "c":
                raise
            reason = f"{name} runs in Python, not in C, {slower}: {error}"
    controller = in_python()
    _log.info("%s runs in Python, solver %s", name, controller.solver_name)
    if reason:
        controller.remarks.append(reason)
        say_once(reason)
    return controller
