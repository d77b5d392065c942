"""Settings of the shipped controllers, and their dotted names."""

import re
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import BaseModel, ConfigDict, Field, model_validator

from qpmpc.errors import InputError
from qpmpc.preview.horizon import HorizonSettings
from qpmpc.problems import leaf_keys, shown_value
from qpmpc.pwa.model import PwaTolerances
from qpmpc.qp.scaling import ScalingSettings
from qpmpc.qp.settings import QpSettings
from qpmpc.settings import apply_settings, hint_in, validated
from qpmpc.solvers.settings import AdmmSettings
from qpmpc.vehicle.parameters import Battery, Vehicle

Model = TypeVar("Model", bound=BaseModel)
Watts = Annotated[float, Field(ge=0.0, le=1e6)]  # beyond any engine and battery together
Celsius = Annotated[float, Field(ge=-100.0, le=150.0)]
Factor = Annotated[float, Field(ge=0.0, le=20.0)]
FORCED_ABOVE_MIN = 0.05
Gain = Annotated[float, Field(ge=0.0, le=1e4)]  # 1: a whole factor within 0.0001 of SOC


class RuleBasedSettings(BaseModel):
    """Thresholds; load levelling after Liu, Peng, Filipi (2005), heat request after the paper.

    Attributes
    ----------
    k_soc_w : P_r = P_d + P_aux + k_soc (SOC_ref - SOC)
    balance : choose SOC_ref for the trip at hand so that it ends at the SOC asked for
    soc_ref_offset : SOC_ref less the SOC to arrive with, used unchanged without `balance`
    on_w, off_w : the engine starts above the first and stops below the second
    min_on_s : shortest run
    power_min_w : least power when it runs for power
    heat_power_w : power when it runs for heat alone
    heat_on_degc, heat_off_degc : heat request below the first, until above the second
    soc_forced : forced on below this SOC; if None 0.05 above the lower limit
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    k_soc_w: Annotated[float, Field(ge=0.0, le=1e8)] = 100e3
    balance: bool = True
    soc_ref_offset: Annotated[float, Field(ge=-0.3, le=0.3)] = 0.0
    on_w: Watts = 8e3
    off_w: Watts = 3e3
    min_on_s: Annotated[int, Field(ge=0, le=600)] = 5
    power_min_w: Watts = 8e3
    heat_power_w: Watts = 4e3
    heat_on_degc: Celsius = 50.0
    heat_off_degc: Celsius = 52.0
    soc_forced: Annotated[float, Field(gt=0.0, lt=1.0)] | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.off_w > self.on_w:
            raise ValueError("off_w must not be above on_w")
        if self.heat_on_degc > self.heat_off_degc:
            raise ValueError("heat_on_degc must not be above heat_off_degc")
        return self

    def forced_below(self, battery: Battery) -> float:
        """Return the SOC below which the engine is forced on."""
        return battery.soc_min + FORCED_ABOVE_MIN if self.soc_forced is None else self.soc_forced


class MhQpSettings(BaseModel):
    """All settings of the controller; dotted names such as `mh_qp.admm.iterations`.

    Attributes
    ----------
    implementation : `c` (the whole controller in C, compiled for this machine), `python`, or
        `auto`: C where there is a compiler and the settings allow it, else Python with a remark
    solver : QP backend of the Python implementation, see `qpmpc.solvers`. Not set: ADMM with the
        iterations of `admm`, which is OSQP in Python and our own code in C
    admm : settings if `solver` is not set, and of `osqp`
    polish : minimise the coming second once more at the plan's prices of SOC and heat, on the
        curves of engine and battery themselves, see `qpmpc.qp.polish`
    prepared : solve the first QP before the trip starts; if not, the rules drive the first steps
        while the solver warms up
    learning : add idle and slope to the fuel map by the fuel injected, see `LearnedFuel`
    certificate : prove each second how good the plan is, see docs/costate.md; in Python alone
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    horizon: HorizonSettings = HorizonSettings()
    pwa: PwaTolerances = PwaTolerances()
    qp: QpSettings = QpSettings()
    scaling: ScalingSettings = ScalingSettings(energy_j=80e3)
    admm: AdmmSettings = AdmmSettings(iterations=30)
    implementation: Literal["auto", "c", "python"] = "auto"
    solver: str | None = None
    polish: bool = True
    prepared: bool = True
    learning: bool = False
    certificate: bool = False


PAPER = MhQpSettings(
    implementation="python",
    polish=False,
    scaling=ScalingSettings(),
    admm=AdmmSettings(),
    horizon=HorizonSettings(short_stages=20, blocks=0, block_s=20, classes=1),
)


class BaselineMpcSettings(BaseModel):
    """Horizon, terminal penalty and the settings that the baseline shares with `mh-qp`.

    The default penalty lambda is the least, in a scan from 1e3 to 1e5 g on NYCC and the truncated
    NEDC, that ends each trip within 0.01 of its initial SOC; a larger one changes SOC-balanced
    fuel by no more than 0.2 % (docs/reproduction.md has the table).

    Attributes
    ----------
    horizon_s : H, the paper has 20, 50 and 100
    qp : as in `mh-qp`; its `soc_penalty_g` is lambda of lambda (SOC(t+H) - SOC_ref)^2
    pwa, scaling, admm : as in `mh-qp`
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    horizon_s: Annotated[int, Field(ge=1, le=2000)] = 20
    qp: QpSettings = QpSettings(soc_penalty_g=30e3)
    pwa: PwaTolerances = PwaTolerances()
    scaling: ScalingSettings = ScalingSettings()
    admm: AdmmSettings = AdmmSettings()

    def as_mh_qp(self) -> MhQpSettings:
        """The same problem as a multi-horizon one without a long horizon."""
        return MhQpSettings(
            implementation="python",
            polish=False,
            horizon=HorizonSettings(short_stages=self.horizon_s, blocks=0, block_s=0, classes=1),
            pwa=self.pwa,
            qp=self.qp,
            scaling=self.scaling,
            admm=self.admm,
        )


class EcmsSettings(BaseModel):
    """Costates of the adaptive ECMS and how they follow the state.

    The defaults come from a scan on NYCC and the truncated NEDC: a tuning to the trips at hand,
    which `mh-qp` does not need.

    Attributes
    ----------
    factor : s at the reference SOC, fuel energy that a unit of stored battery energy is worth
    factor_per_soc : rise of s for a unit of SOC below the reference
    factor_per_soc_s : rise of s each second for a unit of SOC below the reference
    factor_min, factor_max : range of s
    t_cl_band_k : coolant heat has a value within this distance of its lower limit
    heat_factor : fuel energy that coolant heat is worth at the limit itself, per unit
    power_step_w : spacing of the engine powers compared
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    factor: Factor = 2.7
    factor_per_soc: Gain = 10.0
    factor_per_soc_s: Gain = 0.02
    factor_min: Factor = 1.5
    factor_max: Factor = 5.0
    t_cl_band_k: Annotated[float, Field(ge=0.01, le=100.0)] = 3.0
    heat_factor: Factor = 1.5
    power_step_w: Annotated[float, Field(ge=10.0, le=10e3)] = 250.0

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.factor_min > self.factor_max:
            raise ValueError("factor_min must not be above factor_max")
        return self


class ControllerSettings(BaseModel):
    """Settings of every controller; the first part of a dotted name selects the controller.

    Attributes
    ----------
    others : values set in sections of other packages, by section and dotted name
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    rule_based: RuleBasedSettings = RuleBasedSettings()
    mh_qp: MhQpSettings = MhQpSettings()
    mh_qp_paper: MhQpSettings = PAPER
    baseline_mpc: BaselineMpcSettings = BaselineMpcSettings()
    ecms: EcmsSettings = EcmsSettings()
    others: dict[str, dict[str, Any]] = {}

    @classmethod
    def sections(cls) -> tuple[str, ...]:
        """Return the names of the sections of shipped controllers."""
        return tuple(name for name in cls.model_fields if name != "others")

    def idle(self) -> set[str]:
        """Return dotted names of settings that have no effect beside the others."""
        found = set()
        for section in ("mh_qp", "mh_qp_paper"):
            values: MhQpSettings = getattr(self, section)
            found |= {f"{section}.horizon.{name}" for name in values.horizon.idle()}
            if values.solver not in (None, "osqp"):
                found |= {f"{section}.admm.{name}" for name in AdmmSettings.model_fields}
        return found

    def of(self, section: str, default: Model) -> Model:
        """Return the settings of a section that another package owns.

        Raises
        ------
        InputError
            If a setting does not exist or its value is not allowed.
        """
        changed = self.others.get(section, {})
        if not changed:
            return default
        data = apply_settings(default.model_dump(), changed, owner=section)
        return validated(type(default), data, section)

    def with_section(self, section: str, values: BaseModel) -> "ControllerSettings":
        """Return a copy in which a section that another package owns has these values."""
        others = {**self.others, section: values.model_dump()}
        return self.model_copy(update={"others": others})

    def with_settings(self, settings: Mapping[str, object]) -> "ControllerSettings":
        """Return a copy with dotted keys replaced, e.g. ``{"mh_qp.admm.iterations": 25}``.

        Sections of other packages are kept unchanged; their owners check them.

        Raises
        ------
        InputError
            If a key does not exist or a value is not allowed.
        """
        ours: dict[str, object] = {}
        others = {section: dict(values) for section, values in self.others.items()}
        for key, value in settings.items():
            refuse_old_name(key, value)
            section, _, rest = key.partition(".")
            if not rest:
                raise InputError(_without_section(key))
            if section in self.sections():
                ours[key] = value
            else:
                others.setdefault(section, {})[rest] = value
        data = apply_settings(self.model_dump(), ours, owner="controller settings")
        data["others"] = others
        return validated(ControllerSettings, data, "controller settings")


def _without_section(key: str) -> str:
    """Return the message for a name without a dot: a section, or a parameter of one."""
    models = (Vehicle, ControllerSettings)
    if key in {
        name.partition(".")[0] for model in models for name in leaf_keys(model) if "." in name
    }:
        return f"{key!r} is a section: set its parameters one by one, {key}.NAME"
    return (
        f"no parameter {shown_value(key)}{hint_in(key, models)} names start with a section and a "
        "dot, such as thermal.t_amb_degc or mh_qp.admm.iterations"
    )


# Old and new names of settings, below the section of the controller.
RENAMED = {"osqp.sigma": "admm.proximal_weight", "osqp": "admm"}
OLD_SOLVERS = {"auto": "auto", "generated": "c"}


def refuse_old_name(key: str, value: object) -> None:
    """Refuse a setting by the name that it had before version 0.2.

    Raises
    ------
    InputError
        One line with the new name.
    """
    section, _, rest = key.partition(".")
    if section not in ("mh_qp", "mh_qp_paper", "baseline_mpc") or not re.fullmatch(r"[\w.]+", rest):
        return
    for old, new in RENAMED.items():
        if rest == old or rest.startswith(f"{old}."):
            raise InputError(f"{key} is now called {section}.{new}{rest.removeprefix(old)}")
    if rest == "solver" and isinstance(value, str) and value in OLD_SOLVERS:
        now = OLD_SOLVERS[value]
        raise InputError(f"{key}={value} is now called {section}.implementation={now}")


SettingsLike = Mapping[str, object] | ControllerSettings


def as_settings(settings: SettingsLike | None) -> ControllerSettings:
    """Return settings given by dotted name, or made already, or not at all.

    Raises
    ------
    InputError
        If they are neither, or a name or value is not allowed.
    """
    if isinstance(settings, ControllerSettings):
        return settings
    if not isinstance(settings, Mapping | None):
        raise InputError(
            f"settings must be a dictionary of dotted names, not {settings!r}, "
            'such as {"mh_qp.admm.iterations": 25}'
        )
    return ControllerSettings().with_settings(settings or {})
