"""The top layer: every name that a user can type, and its target.

Another package adds controllers, planners, solvers, vehicles, cycles and checks by entry points,
see `Names`; ``docs/extending.md`` shows how.
"""

from collections.abc import Mapping, Sequence

from qpmpc.controllers.base import Controller
from qpmpc.controllers.receding_horizon import Planner, RecedingHorizon
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles.load import CYCLES
from qpmpc.errors import InputError
from qpmpc.names import Names, Shipped, unknown
from qpmpc.solvers.names import SOLVERS
from qpmpc.trip import Trip
from qpmpc.vehicle.names import VEHICLES
from qpmpc.vehicle.parameters import Vehicle

# Called with trip and settings, each makes a controller, or a planner, of this trip.
CONTROLLERS = Names(
    "controller",
    {
        "mh-qp": Shipped("qpmpc.codegen.implementation:mh_qp"),
        "mh-qp-paper": Shipped("qpmpc.codegen.implementation:mh_qp_paper"),
        "rule-based": Shipped("qpmpc.controllers.balance:rule_based"),
        "ecms": Shipped("qpmpc.controllers.ecms:Ecms"),
        "dp": Shipped(
            "qpmpc.verification.dynamic_programming.controller:Dp",
            "numba",
            "verification",
            "qpmpc.verification.dynamic_programming.settings:DpSettings",
        ),
    },
)
PLANNERS = Names(
    "planner",
    {
        "baseline-mpc": Shipped("qpmpc.controllers.baseline_mpc:baseline_mpc"),
        "mh-nlp": Shipped("qpmpc.verification.nonlinear.mh_nlp:MhNlp", "casadi", "verification"),
    },
)
# Each leads to a `Group` of the checks of ``qpmpc verify``, in the order of its report.
CHECKS = Names(
    "check",
    {
        name: Shipped(f"qpmpc.verification.checks.groups:{name.replace('-', '_').upper()}")
        for name in (
            "pwa",
            "relaxation",
            "qp",
            "backends",
            "renderings",
            "nlp",
            "nlp-loop",
            "balances",
            "physics",
            "epa",
            "bounds",
        )
    },
)
TABLES = (CONTROLLERS, PLANNERS, SOLVERS, VEHICLES, CYCLES, CHECKS)

ControllerLike = str | type[Controller] | type[Planner] | Controller | Planner


def controller_names() -> tuple[str, ...]:
    """Return all names that `make_controller` takes, the default first."""
    return (*CONTROLLERS.names(), *PLANNERS.names())


def check_controllers(names: Sequence[str]) -> None:
    """Check that each controller can run here, before any time is spent.

    Raises
    ------
    InputError
        If a name is unknown or given twice, or a package that it needs is not installed.
    """
    for i, name in enumerate(names):
        _table_of(name).check(name)
        if name in names[:i]:
            raise InputError(f"controller {name!r} is named twice")


def make_controller(
    what: ControllerLike, trip: Trip, settings: ControllerSettings | None = None
) -> Controller:
    """Make a controller of one trip.

    Parameters
    ----------
    what : a name, a class of controllers or planners, or one made for this trip already
    trip, settings : that it is made with

    Raises
    ------
    InputError
        If a name is unknown, a package is missing, or a setting does not fit.
    """
    made = what
    if isinstance(what, str):
        made = _table_of(what).find(what)(trip, settings)
    elif isinstance(what, type):
        made = what(trip, settings)
    if isinstance(made, Planner):
        made = RecedingHorizon(trip, made, None if made is what else settings)
    if not isinstance(made, Controller):
        raise InputError(
            f"controller {what!r} is neither a qpmpc.Controller nor a qpmpc.Planner, "
            f"but a {type(made).__name__}"
        )
    if isinstance(what, str):
        made.name = what
    return made


def _table_of(name: str) -> Names:
    for table in (CONTROLLERS, PLANNERS):
        if name in table:
            return table
    raise InputError(unknown("controller", name, controller_names()))


def split_settings(
    settings: Mapping[str, object], controllers: Sequence[ControllerLike] = ()
) -> tuple[dict[str, object], ControllerSettings]:
    """Split dotted settings into those of the vehicle and those of the controllers.

    Parameters
    ----------
    settings : as of ``--set``
    controllers : that will run; a user's own controller gives its section by its class

    Raises
    ------
    InputError
        If the first part of a name is neither, or a controller's setting is not allowed.
    """
    of_vehicle: dict[str, object] = {}
    of_controllers: dict[str, object] = {}
    own = {_section(what.name): what.Settings for what in controllers if not isinstance(what, str)}
    named = {_section(name): name for name in controller_names()}
    for key, value in settings.items():
        section, _, rest = key.partition(".")
        if section in Vehicle.model_fields and rest:
            of_vehicle[key] = value
        elif section in {*ControllerSettings.sections(), *own, *named}:
            of_controllers[key] = value
        else:
            known = {*ControllerSettings.sections(), "dp", *own, *Vehicle.model_fields} - _SCALARS
            raise InputError(
                f"no parameter {key!r}: names start with one of {', '.join(sorted(known))} "
                "and a dot"
            )
    chosen = ControllerSettings().with_settings(of_controllers)
    for section in chosen.others:
        if section in own:
            model = own[section]
        else:
            model = _table_of(named[section]).settings_model(named[section])
        if model is None:
            raise InputError(f"controller {section.replace('_', '-')!r} has no settings of its own")
        chosen.of(section, model())  # refuses wrong settings
    return of_vehicle, chosen


_SCALARS = {"name", "description", "base"}


def _section(name: str) -> str:
    return name.replace("-", "_")
