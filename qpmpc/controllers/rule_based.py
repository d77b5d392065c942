"""Rule-based reference: load levelling, plus engine on for heat (the paper's baseline)."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from qpmpc.controllers.base import Decision, Observation
from qpmpc.controllers.safety import SafetyLayer
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.vehicle.plant import Command, Plant

Watts = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]


class RuleBasedSettings(BaseModel):
    """Thresholds; load levelling after Liu, Peng, Filipi (2005), heat request after the paper.

    Attributes
    ----------
    k_soc_w : P_r = P_d + P_aux + k_soc (SOC_ref - SOC)
    balance : choose SOC_ref for the trip at hand so that it ends at its initial SOC
    soc_ref_offset : SOC_ref - SOC_init, used as it is without `balance`
    on_w, off_w : the engine starts above the first and stops below the second
    min_on_s : shortest run
    power_min_w : least power when it runs for power
    heat_power_w : power when it runs for heat alone
    heat_on_degc, heat_off_degc : heat request below the first, until above the second
    soc_forced : forced on below this SOC
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    k_soc_w: Watts = 100e3
    balance: bool = True
    soc_ref_offset: Annotated[float, Field(ge=-0.3, le=0.3)] = 0.0
    on_w: Watts = 8e3
    off_w: Watts = 3e3
    min_on_s: Annotated[int, Field(ge=0, le=600)] = 5
    power_min_w: Watts = 8e3
    heat_power_w: Watts = 4e3
    heat_on_degc: float = 50.0
    heat_off_degc: float = 52.0
    soc_forced: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.45


class RuleBased:
    """Rule-based controller (no preview)."""

    name = "rule-based"
    solver_name = ""

    def __init__(self, plant: Plant, settings: RuleBasedSettings | None = None) -> None:
        self.settings = settings or RuleBasedSettings()
        self._vehicle: Vehicle = plant.vehicle
        self._safety = SafetyLayer(plant, self.settings.heat_power_w)
        self._power_request = False
        self._heat_request = False
        self._on_for_s = 0

    def decide(self, seen: Observation) -> Decision:
        """Apply the rules, then the safety layer."""
        s, battery = self.settings, self._vehicle.battery
        net_w = seen.demand_w + battery.aux_power_w
        reference = self._vehicle.trip.soc_init + s.soc_ref_offset
        requested = net_w + s.k_soc_w * (reference - seen.soc)
        forced = seen.soc < s.soc_forced or net_w > battery.power_discharge_max_w
        if requested > s.on_w or forced:
            self._power_request = True
        elif requested < s.off_w and self._on_for_s >= s.min_on_s:
            self._power_request = False
        if seen.t_cl_degc < s.heat_on_degc:
            self._heat_request = True
        elif seen.t_cl_degc > s.heat_off_degc:
            self._heat_request = False
        wish = Command(False, 0.0)
        if self._power_request:
            wish = Command(True, max(requested, s.power_min_w))
        elif self._heat_request or 0 < self._on_for_s < s.min_on_s:
            wish = Command(True, s.heat_power_w)
        command = self._safety.admissible(wish, seen)
        self._on_for_s = self._on_for_s + 1 if command.engine_on else 0
        return Decision(command)
