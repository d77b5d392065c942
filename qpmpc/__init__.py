"""Multi-horizon MPC, posed as a QP, for the power and thermal management of hybrid cars.

All public names are here; each is imported on first use, so that importing the package costs
nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from qpmpc._clash import refuse_other_qpmpc
from qpmpc._version import __version__ as __version__

if TYPE_CHECKING:
    from qpmpc.comparison import Runs as Runs
    from qpmpc.comparison import compare as compare
    from qpmpc.controllers.base import Controller as Controller
    from qpmpc.controllers.base import Decision as Decision
    from qpmpc.controllers.cvxpy_planner import CvxpyPlanner as CvxpyPlanner
    from qpmpc.controllers.mh_qp import MhQp as MhQp
    from qpmpc.controllers.receding_horizon import Plan as Plan
    from qpmpc.controllers.receding_horizon import Planner as Planner
    from qpmpc.controllers.receding_horizon import RecedingHorizon as RecedingHorizon
    from qpmpc.controllers.settings import ControllerSettings as ControllerSettings
    from qpmpc.cycles import Cycle as Cycle
    from qpmpc.cycles import load_cycle as load_cycle
    from qpmpc.errors import InputError as InputError
    from qpmpc.errors import QpmpcError as QpmpcError
    from qpmpc.results import Run as Run
    from qpmpc.simulation import simulate as simulate
    from qpmpc.study.results import StudyResults as StudyResults
    from qpmpc.study.sweep import sweep as sweep
    from qpmpc.trip import Observation as Observation
    from qpmpc.trip import Trip as Trip
    from qpmpc.vehicle import Command as Command
    from qpmpc.vehicle import Vehicle as Vehicle
    from qpmpc.vehicle import load_vehicle as load_vehicle

refuse_other_qpmpc()

_HOME = {
    "Command": "vehicle",
    "Controller": "controllers.base",
    "ControllerSettings": "controllers.settings",
    "CvxpyPlanner": "controllers.cvxpy_planner",
    "Cycle": "cycles",
    "Decision": "controllers.base",
    "InputError": "errors",
    "MhQp": "controllers.mh_qp",
    "Observation": "trip",
    "Plan": "controllers.receding_horizon",
    "Planner": "controllers.receding_horizon",
    "QpmpcError": "errors",
    "RecedingHorizon": "controllers.receding_horizon",
    "Run": "results",
    "Runs": "comparison",
    "StudyResults": "study.results",
    "Trip": "trip",
    "Vehicle": "vehicle",
    "compare": "comparison",
    "load_cycle": "cycles",
    "load_vehicle": "vehicle",
    "simulate": "simulation",
    "sweep": "study.sweep",
}

__all__ = [*_HOME]


def __getattr__(name: str) -> Any:
    """Import a public name on first use."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})
