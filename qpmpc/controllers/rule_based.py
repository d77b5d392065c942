"""Rule-based reference: load levelling, plus engine on for heat (the paper's baseline)."""

from qpmpc.controllers.base import Controller, Progress
from qpmpc.controllers.settings import ControllerSettings, RuleBasedSettings
from qpmpc.trip import Observation, Trip
from qpmpc.vehicle.must_run import must_run
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.vehicle.plant import Command

LAST_RUNG_HEAT_K = (1.0, 3.0)  # above the lower coolant limit: heat request on and off


def last_rung(rules: RuleBasedSettings, vehicle: Vehicle) -> RuleBasedSettings:
    """Return the rules that drive for some seconds where there is no plan.

    They ask for heat near the lower coolant limit only: what a plan saves by keeping the coolant
    cooler than the rules would is otherwise lost in every such second.
    """
    least = vehicle.thermal.t_cl_min_degc
    on_degc, off_degc = (least + above for above in LAST_RUNG_HEAT_K)
    update = {
        "heat_on_degc": min(rules.heat_on_degc, on_degc),
        "heat_off_degc": min(rules.heat_off_degc, off_degc),
    }
    return rules.model_copy(update=update)


class RuleBased(Controller):
    """Rule-based controller (no preview).

    Parameters
    ----------
    trip, settings : as of `Controller`
    rules : thresholds; those of the settings if None
    """

    name = "rule-based"

    def __init__(
        self,
        trip: Trip,
        settings: ControllerSettings | None = None,
        rules: RuleBasedSettings | None = None,
    ) -> None:
        super().__init__(trip, settings)
        self.rules = rules or self.settings.rule_based
        self._power_request = False
        self._heat_request = False

    def depart(self, progress: Progress | None = None) -> None:
        """Reset the rules."""
        self._power_request = self._heat_request = False

    def forget(self) -> None:
        """Forget measurements and requests, as after a restart of the ECU under way."""
        super().forget()
        self.depart()

    def step(self, seen: Observation) -> Command:
        """Apply the rules."""
        s, vehicle = self.rules, self.trip.vehicle
        battery = vehicle.battery
        net_w = seen.demand_w + battery.aux_power_w
        reference = vehicle.trip.soc_target + s.soc_ref_offset
        requested = net_w + s.k_soc_w * (reference - seen.soc)
        forced = seen.soc < s.forced_below(battery) or must_run(vehicle, net_w, seen.speed_mps)
        shortest_s = max(s.min_on_s, vehicle.engine.min_on_s)
        is_held = seen.engine_on and seen.engine_for_s < shortest_s
        if requested > s.on_w or forced:
            self._power_request = True
        elif requested < s.off_w and not is_held:
            self._power_request = False
        if seen.t_cl_degc < s.heat_on_degc:
            self._heat_request = True
        elif seen.t_cl_degc > s.heat_off_degc:
            self._heat_request = False
        wish = Command(False, 0.0)
        if self._power_request:
            wish = Command(True, max(requested, s.power_min_w))
        elif self._heat_request or is_held:
            wish = Command(True, s.heat_power_w)
        return wish
