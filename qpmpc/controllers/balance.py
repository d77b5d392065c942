"""Charge balance of the rules: the SOC reference at which they end a trip as they began it."""

import numpy as np

from qpmpc.controllers.base import Observation
from qpmpc.controllers.rule_based import RuleBased, RuleBasedSettings
from qpmpc.preview.forecast import Trace
from qpmpc.vehicle.plant import Plant

WIDEST_OFFSET = 0.2
SCAN_STEP = 0.01
BISECTIONS = 10


def soc_drift(plant: Plant, truth: Trace, settings: RuleBasedSettings) -> float:
    """SOC_end - SOC_init of the rules over a trip."""
    rules = RuleBased(plant, settings)
    state = plant.initial_state()
    for t, (demand_w, speed_mps) in enumerate(
        zip(truth.demand_w.tolist(), truth.speed_mps.tolist(), strict=True)
    ):
        seen = Observation(t, state.soc, state.t_cl_degc, state.engine_on, demand_w, speed_mps)
        state, _ = plant.step(state, rules.decide(seen).command, demand_w, speed_mps)
    return state.soc - plant.vehicle.trip.soc_init


def balanced(plant: Plant, truth: Trace, settings: RuleBasedSettings) -> RuleBasedSettings:
    """Return the settings with the SOC reference that balances this trip best.

    The reference is sought outward from the initial SOC: the first offset at which the drift
    changes sign, refined by bisection; where it never does, the offset of the smallest drift.
    Rules with timers jump, so the smallest drift met on the way is what counts. This needs the
    trip in advance, as any charge-sustaining comparison of rules does; it is no causal tuning.
    """

    def drift(offset: float) -> float:
        trial = settings.model_copy(update={"soc_ref_offset": offset})
        return soc_drift(plant, truth, trial)

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
    return settings.model_copy(update={"soc_ref_offset": best})
