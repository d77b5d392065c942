"""A second that the battery cannot drive without falling below its lower SOC limit.

The plan relaxes on and off to a share. What it gives by a share below one half is rounded away from
second to second, until the limit stands in the next one. The safety layer would then give what that
second lacks, however little, and again in the next: the engine's worst power, a second at a time.
So it is with what the ramp asks for in good time.

The same in C: codegen/runtime/mpc_empty_battery.c.
"""

from qpmpc.controllers.safety import SOC_MARGIN
from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.vehicle.parameters import Battery
from qpmpc.vehicle.section import STEP_S


def empties(battery: Battery, maps: BatteryMaps, net_w: float, soc: float) -> bool:
    """Return whether a second driven by the battery alone ends below its lower SOC limit.

    P0 > P_reach(soc, soc_min + margin, 1 s), as the safety layer has it.

    Parameters
    ----------
    battery, maps : limit and curves
    net_w : P0 of the coming second, W
    soc : state of charge now
    """
    return net_w > maps.power_to_reach_w(soc, battery.soc_min + SOC_MARGIN, STEP_S)


def empty_battery_w(
    battery: Battery, maps: BatteryMaps, net_w: float, soc: float, power_w: float, ramp_w: float
) -> float:
    """Return the power at which the engine runs because the battery needs it, W; 0 if it does not.

    It does where the coming second would empty the battery or the ramp asks for power. That is its
    least-cost power then, what the ramp asks for at least: what it gives beyond the second's need
    spares the next ones a start.

    Parameters
    ----------
    battery, maps, net_w, soc : as of `empties`
    power_w : least-cost power of the second at the plan's prices, see `Polish`
    ramp_w : least power for the ramp, see `qpmpc.controllers.ramp`
    """
    if ramp_w <= 0.0 and not empties(battery, maps, net_w, soc):
        return 0.0
    return max(power_w, ramp_w)
