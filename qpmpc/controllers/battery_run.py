"""The battery at its lower limit: a run goes on, or begins, for what it lacks in the seconds ahead.

A plan of shares gets the little that the battery lacks before the next braking by a twentieth of a
run in each of the seconds ahead, and rounds it away. The engine stops, and a few seconds later the
limit stands in the next second: another start, as often as not just before braking.

The same in C: codegen/runtime/mpc_battery_run.c.
"""

import numpy as np
from numpy.typing import NDArray

from qpmpc.controllers.last_run import SAME_G
from qpmpc.controllers.realise import ON_THRESHOLD
from qpmpc.controllers.safety import SOC_MARGIN
from qpmpc.preview.stages import Stages
from qpmpc.pwa.priced import Going
from qpmpc.qp.rows import table_of
from qpmpc.trip import Observation
from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.vehicle.parameters import Vehicle


def battery_run_w(
    vehicle: Vehicle,
    maps: BatteryMaps,
    going: Going,
    stages: Stages,
    on_share: NDArray[np.float64],
    seen: Observation,
) -> float:
    """Return the power at which the engine runs for what the battery lacks; 0 if it need not.

    With the engine at rest until the next second in which it has to run or the plan runs it,
    sigma_k >= 1/2, the battery lacks

        J = max_k sum of h_i l_off,i over i <= k, less E_bat (SOC - SOC_min - `SOC_MARGIN`)

    with E_bat at the voltage of the limit. Nothing is done unless J > 0: some second then takes SOC
    below its limit, k = j the first. With g_k, d_k and c as in `last_run_w`, and D_s the sum of d_k
    over a shortest run from second s,

    - a run that is under way goes on if that costs no more than another start, d_0 J / g_0 <= c
    - one begins now if D_0 < D_s, by more than rounding, for all s = 1 .. j of which the run ends
      before arrival and in the short horizon: one of them has to begin, and on a steady road the
      last, because the need is known better then

    Parameters
    ----------
    vehicle : gives b, c, E_bat and SOC_min
    maps : of the battery
    going : as of `last_run_w`
    stages : of the plan, from now on
    on_share : sigma of the seconds ahead by the plan, shape (N,)
    seen : the present
    """
    engine, battery, seconds = vehicle.engine, vehicle.battery, len(on_share)
    if not table_of(engine).has_start:
        return 0.0
    h, must_share = stages.duration_s[:seconds], stages.must_share[:seconds]
    runs = (on_share >= ON_THRESHOLD) | (must_share >= ON_THRESHOLD)
    rests = int(np.argmax(runs)) if runs.any() else seconds
    to_spare = seen.soc - (battery.soc_min + SOC_MARGIN)
    spent_j = np.cumsum(h * stages.internal_off_w[:seconds])[:rests]
    lacks_j = spent_j - maps.energy_j(battery.soc_min) * to_spare
    lack_j = float(lacks_j.max(initial=0.0))
    if lack_j <= 0.0:
        return 0.0

    power_w, gain_w, dearer_g_per_s = (float(each[0]) for each in going)
    if seen.engine_on:
        pays = dearer_g_per_s * lack_j <= engine.start_fuel_g * gain_w
        return power_w if pays else 0.0
    run_s, begins_by = max(engine.min_on_s, 1), int(np.argmax(lacks_j > 0.0))
    if len(stages.seconds_w(seconds)) < run_s:
        return 0.0
    runs_g = np.convolve(going.dearer_g_per_s, np.ones(run_s), "valid")
    later_g = runs_g[1 : begins_by + 1][h[run_s : begins_by + run_s] > 0.0]
    return power_w if runs_g[0] + SAME_G <= later_g.min(initial=np.inf) else 0.0
