"""The top layer: every name that a user can type, and its target.

Another package adds controllers, planners, solvers, vehicles, cycles, checks and plants by entry
points, see `Names`; ``docs/extending.md`` shows how.
"""

import inspect
from collections.abc import Callable, Mapping, Sequence

from qpmpc.controllers.base import Controller
from qpmpc.controllers.receding_horizon import Planner, RecedingHorizon
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles.load import CYCLES
from qpmpc.errors import InputError
from qpmpc.names import Names, Shipped, hint, unknown
from qpmpc.nearest import nearest
from qpmpc.problems import shown_value
from qpmpc.settings import hint_in
from qpmpc.solvers.names import SOLVERS
from qpmpc.trip import Trip
from qpmpc.vehicle.belief import is_of_model
from qpmpc.vehicle.names import VEHICLES
from qpmpc.vehicle.parameters import Vehicle

# Called with trip and settings, each makes a controller, or a planner, of this trip.
_CONTROLLERS = {
    "mh-qp": Shipped("qpmpc.codegen.implementation:mh_qp"),
    "mh-qp-paper": Shipped("qpmpc.codegen.implementation:mh_qp_paper"),
    "mh-costate": Shipped(
        "qpmpc.codegen.implementation:mh_costate",
        settings="qpmpc.controllers.mh_costate:MhCostateSettings",
    ),
    "rule-based": Shipped("qpmpc.controllers.balance:rule_based"),
    "ecms": Shipped("qpmpc.controllers.ecms:Ecms"),
    "dp": Shipped(
        "qpmpc.verification.dynamic_programming.controller:Dp",
        "numba",
        "verification",
        "qpmpc.verification.dynamic_programming.settings:DpSettings",
    ),
}
_PLANNERS = {
    "baseline-mpc": Shipped("qpmpc.controllers.baseline_mpc:baseline_mpc"),
    "mh-nlp": Shipped("qpmpc.verification.nonlinear.mh_nlp:MhNlp", "casadi", "verification"),
}
CONTROLLERS = Names("controller", _CONTROLLERS, beside=_PLANNERS)
PLANNERS = Names("planner", _PLANNERS, beside=_CONTROLLERS)
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
            "safety",
            "epa",
            "bounds",
            "starts",
        )
    },
)
# Each leads to a `ForeignCar`, whose own control has the same name among the controllers.
PLANTS = Names(
    "plant",
    {
        name: Shipped(f"qpmpc.verification.fastsim.car:{target}", "fastsim", "fastsim")
        for name, target in (("fastsim", "FASTSIM"), ("fastsim-sonata", "FASTSIM_SONATA"))
    },
)
TABLES = (CONTROLLERS, PLANNERS, SOLVERS, VEHICLES, CYCLES, CHECKS, PLANTS)

ControllerLike = str | type[Controller] | type[Planner] | Controller | Planner


def controller_names() -> tuple[str, ...]:
    """Return all names that `make_controller` takes, the default first."""
    return (*CONTROLLERS.names(), *PLANNERS.names())


def check_controllers(controllers: Sequence[ControllerLike], own: str = "") -> None:
    """Check that each controller can run here, before any time is spent.

    Parameters
    ----------
    controllers : to be checked
    own : name of a foreign plant's own control, if there is one

    Raises
    ------
    InputError
        If one is neither name nor class nor controller, a name is unknown or given twice, a class
        of somebody else's has a shipped name, or a package that one needs is not installed.
    """
    shipped = {*CONTROLLERS.shipped, *PLANNERS.shipped}
    names: list[str] = []
    for what in controllers:
        if not (isinstance(what, str | Controller | Planner) or _can_be_made(what)):
            raise InputError(
                f"controller {what!r} is no name, no class of controllers or planners that can be "
                "made of a trip and settings, and none that is made"
            )
        name = what if isinstance(what, str) else getattr(what, "name", repr(what))
        if isinstance(what, str):
            if name != own:
                _table_of(name).check(name)
        elif name in shipped and not _kind(what).__module__.startswith("qpmpc."):
            raise InputError(f"controller {name!r}: this name is that of a shipped one")
        if name in names:
            raise InputError(f"controller {name!r} is named twice")
        names.append(name)


def _can_be_made(what: object) -> bool:
    kinds = Controller | Planner
    return isinstance(what, type) and issubclass(what, kinds) and what is not RecedingHorizon


def _kind(what: object) -> type:
    return what if isinstance(what, type) else type(what)


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
    QpmpcError
        If one that is made already belongs to another trip or has driven.
    """
    made: object = what
    if isinstance(what, str):
        made = _called(_table_of(what).find(what), what, trip, settings)
    elif isinstance(what, type):
        made = _called(what, what.__name__, trip, settings)
    if not isinstance(made, Controller | Planner):
        raise InputError(
            f"controller {what!r} is neither a qpmpc.Controller nor a qpmpc.Planner, "
            f"but a {type(made).__name__}"
        )
    if isinstance(what, str) and made.name != what:
        raise InputError(
            f"controller {what!r} leads to one with the name {made.name!r}: the two must be equal"
        )
    if isinstance(made, Planner):
        made = RecedingHorizon(trip.as_believed, made, None if made is what else settings)
    made.check_ready(trip)
    return made


def _called(
    maker: Callable[..., object], name: str, trip: Trip, settings: ControllerSettings | None
) -> object:
    """Call what makes a controller, if it can be called so."""
    missing = sorted(getattr(maker, "__abstractmethods__", ()))
    if missing:
        raise InputError(f"controller {name!r} lacks {', '.join(missing)}")
    try:
        inspect.signature(maker).bind(trip, settings)
    except TypeError as error:
        raise InputError(
            f"controller {name!r} must be made of a trip and settings: {error}"
        ) from error
    return maker(trip if getattr(maker, "knows_plant", False) else trip.as_believed, settings)


def _table_of(name: str) -> Names:
    for table in (CONTROLLERS, PLANNERS):
        if name in table:
            return table
    if name in PLANTS:
        raise InputError(
            f"controller {name!r} is what the plant of that name comes with: "
            f"qpmpc compare .. --plant {name}"
        )
    raise InputError(unknown("controller", name, controller_names()))


def split_settings(
    settings: Mapping[str, object], controllers: Sequence[ControllerLike] = ()
) -> tuple[dict[str, object], ControllerSettings]:
    """Split dotted settings into those of the trip and those of the controllers.

    Those of the trip are its vehicle's and those of the controllers' model of it, for
    `Trip.with_settings`.

    Parameters
    ----------
    settings : as of ``--set``
    controllers : that will run; a user's own controller gives its section by its class

    Raises
    ------
    InputError
        If the first part of a name is neither, or a controller's setting is not allowed.
    """
    of_vehicle = {key: value for key, value in settings.items() if _is_of_trip(key)}
    of_controllers = {key: value for key, value in settings.items() if key not in of_vehicle}
    chosen = ControllerSettings().with_settings(of_controllers)
    check_sections(chosen, controllers)
    return of_vehicle, chosen


def is_of_vehicle(key: str) -> bool:
    """Whether a dotted setting is one of the vehicle."""
    return key.partition(".")[0] in Vehicle.model_fields and "." in key


def _is_of_trip(key: str) -> bool:
    return is_of_vehicle(key) or is_of_model(key)


def check_sections(
    settings: ControllerSettings, controllers: Sequence[ControllerLike] = ()
) -> None:
    """Check the settings of sections that no controller of the core has.

    Raises
    ------
    InputError
        If there is no controller of that name, or a value is not allowed.
    """
    own = {_section(what.name): what.Settings for what in controllers if not isinstance(what, str)}
    named = {_section(name): name for name in controller_names()}
    for section, values in settings.others.items():
        if section in own:
            model = own[section]
        elif section in named:
            model = _table_of(named[section]).settings_model(named[section])
        else:
            added = [_section(name) for name in (*CONTROLLERS.added, *PLANNERS.added)]
            known = sorted(
                {*ControllerSettings.sections(), "dp", "model", *own, *added, *Vehicle.model_fields}
                - _SCALARS
            )
            key = ".".join([section, *list(values)[:1]])
            meant = (
                hint(section, known)
                if nearest(section, known)
                else hint_in(key, (Vehicle, ControllerSettings))
            )
            raise InputError(
                f"no parameter {shown_value(key)}{meant} names start with "
                f"one of {', '.join(known)} and a dot"
            )
        if model is None:
            raise InputError(f"controller {section.replace('_', '-')!r} has no settings of its own")
        settings.of(section, model())  # refuses wrong settings


def reads(controller: str, key: str) -> bool:
    """Whether a setting, or the ``forecast``, has an effect on a controller of this name.

    Controllers of somebody else's may read any of them.
    """
    if is_of_model(key):
        # the plant is known to one, the others' own
        return controller != "dp" and controller not in PLANTS.shipped
    if controller not in _READS or key.partition(".")[0] in Vehicle.model_fields:
        return True
    return any(key == part or key.startswith(f"{part}.") for part in _READS[controller])


def without_effect(settings: Mapping[str, object], controllers: Sequence[ControllerLike]) -> str:
    """Say which settings of shipped controllers reach none of those that will run.

    Or are of none beside the others: those of demand classes, where there is one. Controllers of
    somebody else's may read any of them.
    """
    if not all(isinstance(what, str) and what in _READS for what in controllers):
        return ""
    names = [what for what in controllers if isinstance(what, str)]
    idle = {key for key in settings if not any(reads(name, key) for name in names)}
    of_controllers = {key: value for key, value in settings.items() if not _is_of_trip(key)}
    idle |= ControllerSettings().with_settings(of_controllers).idle() & settings.keys()
    return f"no effect on {', '.join(names)}: {', '.join(sorted(idle))}" if idle else ""


# Settings that shipped controllers read, by the beginning of their names, and whether they read
# the forecast; the rules are the last rung of most.
_READS = {
    "mh-qp": ("mh_qp", "rule_based", "forecast"),
    "mh-qp-paper": ("mh_qp_paper", "rule_based", "forecast"),
    "baseline-mpc": ("baseline_mpc", "rule_based", "forecast"),
    "mh-costate": ("mh_costate", "rule_based", "forecast"),
    "mh-nlp": ("mh_qp.horizon", "mh_qp.qp", "rule_based", "forecast"),
    "rule-based": ("rule_based",),
    "ecms": ("ecms", "rule_based"),
    "dp": ("dp",),
    **dict.fromkeys(PLANTS.shipped, ()),
}
_SCALARS = {"name", "description", "base"}


def _section(name: str) -> str:
    return name.replace("-", "_")
