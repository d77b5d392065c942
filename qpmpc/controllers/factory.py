"""Controllers by name, with their settings and dotted overrides."""

from collections.abc import Callable

from pydantic import BaseModel, ConfigDict

from qpmpc.controllers.balance import balanced
from qpmpc.controllers.base import Controller
from qpmpc.controllers.baseline_mpc import BaselineMpcSettings, baseline_mpc
from qpmpc.controllers.ecms import Ecms, EcmsSettings
from qpmpc.controllers.mh_qp import MhQp, MhQpSettings
from qpmpc.controllers.rule_based import RuleBased, RuleBasedSettings
from qpmpc.errors import InputError
from qpmpc.preview.forecast import Trace
from qpmpc.preview.horizon import HorizonSettings
from qpmpc.settings import apply_settings, validated
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.vehicle.plant import Plant
from qpmpc.verification.dynamic_programming.settings import DpSettings

PAPER = MhQpSettings(
    solver="osqp",
    horizon=HorizonSettings(short_stages=20, blocks=0, block_s=20, classes=1),
)


class ControllerSettings(BaseModel):
    """Settings of every controller; the first part of a dotted name picks the controller."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    rule_based: RuleBasedSettings = RuleBasedSettings()
    mh_qp: MhQpSettings = MhQpSettings()
    mh_qp_paper: MhQpSettings = PAPER
    baseline_mpc: BaselineMpcSettings = BaselineMpcSettings()
    ecms: EcmsSettings = EcmsSettings()
    dp: DpSettings = DpSettings()

    def with_settings(self, settings: dict[str, object]) -> "ControllerSettings":
        """Return a copy with dotted keys replaced, e.g. ``{"mh_qp.osqp.iterations": 25}``.

        Raises
        ------
        InputError
            If a key does not exist or a value is not allowed.
        """
        data = apply_settings(self.model_dump(), settings, owner="controller settings")
        return validated(ControllerSettings, data, "controller settings")


def split_settings(
    settings: dict[str, object],
) -> tuple[dict[str, object], dict[str, object]]:
    """Split dotted settings into those of the vehicle and those of the controllers.

    Raises
    ------
    InputError
        If the first part of a name is neither.
    """
    vehicle: dict[str, object] = {}
    controllers: dict[str, object] = {}
    for key, value in settings.items():
        section = key.split(".")[0]
        if section in ControllerSettings.model_fields:
            controllers[key] = value
        elif section in Vehicle.model_fields and "." in key:
            vehicle[key] = value
        else:
            allowed = sorted({*ControllerSettings.model_fields, *Vehicle.model_fields} - SCALARS)
            raise InputError(
                f"no parameter {key!r}: names start with one of {', '.join(allowed)} and a dot"
            )
    return vehicle, controllers


SCALARS = {"name", "description"}


def _rule_based(plant: Plant, truth: Trace, forecast: Trace, s: ControllerSettings) -> Controller:
    rules = s.rule_based
    return RuleBased(plant, balanced(plant, truth, rules) if rules.balance else rules)


def _mh_qp(plant: Plant, truth: Trace, forecast: Trace, s: ControllerSettings) -> Controller:
    solver = s.mh_qp.solver
    if solver != "osqp":
        # here, as it imports this module
        from qpmpc.codegen import CodegenError, compiler, generated_controller

        if solver == "generated" or compiler() is not None:
            try:
                return generated_controller(plant, truth, forecast, s)
            # a setting that generated code does not have, or a compiler that is none
            except (InputError, CodegenError):
                if solver == "generated":
                    raise
    return MhQp("mh-qp", plant, truth, forecast, s.mh_qp, s.rule_based)


def _mh_qp_paper(plant: Plant, truth: Trace, forecast: Trace, s: ControllerSettings) -> Controller:
    return MhQp("mh-qp-paper", plant, truth, forecast, s.mh_qp_paper, s.rule_based)


def _baseline_mpc(plant: Plant, truth: Trace, forecast: Trace, s: ControllerSettings) -> Controller:
    return baseline_mpc(plant, truth, s.baseline_mpc, s.rule_based)


def _ecms(plant: Plant, truth: Trace, forecast: Trace, s: ControllerSettings) -> Controller:
    return Ecms(plant, s.ecms, s.rule_based.heat_power_w)


def _mh_nlp(plant: Plant, truth: Trace, forecast: Trace, s: ControllerSettings) -> Controller:
    from qpmpc.verification.nonlinear.mh_nlp import make_mh_nlp  # only here: it takes CasADi

    return make_mh_nlp(plant, truth, forecast, s)


_MAKERS: dict[str, Callable[[Plant, Trace, Trace, ControllerSettings], Controller]] = {
    "mh-qp": _mh_qp,
    "mh-qp-paper": _mh_qp_paper,
    "baseline-mpc": _baseline_mpc,
    "ecms": _ecms,
    "rule-based": _rule_based,
    "mh-nlp": _mh_nlp,
}


def controller_names() -> tuple[str, ...]:
    """Return the names of the causal controllers, the default first."""
    return tuple(_MAKERS)


def make_controller(
    name: str,
    plant: Plant,
    truth: Trace,
    forecast: Trace | None = None,
    settings: ControllerSettings | None = None,
) -> Controller:
    """Make a controller for one trip.

    Parameters
    ----------
    name : one of `controller_names`
    plant : vehicle and its maps
    truth : what the short horizon sees
    forecast : what the long horizon sees; the truth if None
    settings : of all controllers

    Raises
    ------
    InputError
        If the name is unknown.
    """
    if name not in _MAKERS:
        raise InputError(f"unknown controller {name!r}: use one of {', '.join(_MAKERS)}")
    return _MAKERS[name](plant, truth, forecast or truth, settings or ControllerSettings())
