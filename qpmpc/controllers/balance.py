"""Charge balance of the rules: the SOC reference with which they arrive as asked."""

import numpy as np

from qpmpc.controllers.rule_based import RuleBased
from qpmpc.controllers.settings import ControllerSettings, RuleBasedSettings
from qpmpc.trip import Trip

WIDEST_OFFSET = 0.2
SCAN_STEP = 0.01
BISECTIONS = 10


def soc_drift(trip: Trip, rules: RuleBasedSettings) -> float:
    """Final SOC of the rules less the SOC asked for, over a trip."""
    driver, state = RuleBased(trip, rules=rules), trip.plant.initial_state()
    for t in range(trip.steps):
        seen = trip.observation(t, state)
        command = driver.decide(seen).command
        state, _ = trip.plant.step(state, command, seen.demand_w, seen.speed_mps)
    return state.soc - trip.vehicle.trip.soc_target


def balanced(trip: Trip, rules: RuleBasedSettings) -> RuleBasedSettings:
    """Return the thresholds with the SOC reference that balances this trip best.

    The reference is sought outward from the SOC asked for: the first offset at which the drift
    changes sign, refined by bisection; if it never does, the offset of the smallest drift.
    Rules with timers jump, so the smallest drift found on the way is used. This needs the trip in
    advance, as any charge-sustaining comparison of rules does; it is not a causal tuning.
    """

    def drift(offset: float) -> float:
        trial = rules.model_copy(update={"soc_ref_offset": offset})
        return soc_drift(trip, trial)

    seen = {0.0: drift(0.0)}
    direction = -1.0 if seen[0.0] > 0.0 else 1.0
    previous = 0.0
    for offset in (direction * np.arange(SCAN_STEP, WIDEST_OFFSET + 1e-9, SCAN_STEP)).tolist():
        seen[offset] = drift(offset)
        if seen[offset] * seen[0.0] <= 0.0:
            inner, outer = previous, offset
            for _ in range(BISECTIONS):
                middle = 0.5 * (inner + outer)
                seen[middle] = drift(middle)
                if seen[middle] * seen[0.0] > 0.0:
                    inner = middle
                else:
                    outer = middle
            break
        previous = offset
    best = min(seen, key=lambda offset: abs(seen[offset]))
    return rules.model_copy(update={"soc_ref_offset": best})


def rule_based(trip: Trip, settings: ControllerSettings | None = None) -> RuleBased:
    """Make the rules for one trip, charge-balanced if so set."""
    settings = settings or ControllerSettings()
    rules = settings.rule_based
    return RuleBased(trip, settings, balanced(trip, rules) if rules.balance else rules)
