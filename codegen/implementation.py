"""Which implementation runs a QP controller on this machine: generated C, or Python."""

from qpmpc.codegen.c_compiler import CodegenError, compiler
from qpmpc.codegen.controller import GeneratedController
from qpmpc.controllers.base import Controller
from qpmpc.controllers.qp_planner import QpPlanner
from qpmpc.controllers.receding_horizon import RecedingHorizon
from qpmpc.controllers.settings import ControllerSettings, MhQpSettings
from qpmpc.errors import InputError
from qpmpc.remarks import say_once
from qpmpc.trip import Trip

SLOWER = "steps take several times longer (mh_qp.implementation=python says that this is meant)"


def mh_qp(trip: Trip, settings: ControllerSettings | None = None) -> Controller:
    """Make `mh-qp` in the implementation that is set."""
    settings = settings or ControllerSettings()
    return _made("mh-qp", trip, settings, settings.mh_qp)


def mh_qp_paper(trip: Trip, settings: ControllerSettings | None = None) -> Controller:
    """Make `mh-qp-paper`: the paper's grid and averaged preview."""
    settings = settings or ControllerSettings()
    return _made("mh-qp-paper", trip, settings, settings.mh_qp_paper)


def _made(name: str, trip: Trip, settings: ControllerSettings, of_qp: MhQpSettings) -> Controller:
    """Make a controller in C or Python; a fallback of `auto` is reported with its reason.

    Raises
    ------
    InputError, CodegenError
        If C is set and not available.
    """
    reason = ""
    if of_qp.implementation != "python":
        try:
            if of_qp.implementation == "auto" and compiler() is None:
                raise CodegenError("no C compiler found (tried $CC, cc, gcc, clang)")
            return GeneratedController(trip, settings, of_qp, name=name)
        except (InputError, CodegenError) as error:
            if of_qp.implementation == "c":
                raise
            reason = f"{name} runs in Python, not in C, {SLOWER}: {error}"
    controller = RecedingHorizon(trip, QpPlanner(trip, settings, of_qp, name=name))
    if reason:
        controller.remarks.append(reason)
        say_once(reason)
    return controller
