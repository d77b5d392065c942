"""Numbers for the C code that makes the long horizon's statistics from a forecast of the trip."""

from qpmpc.preview.horizon import HorizonSettings
from qpmpc.vehicle.parameters import Vehicle


def forecast_scalars(vehicle: Vehicle, horizon: HorizonSettings) -> dict[str, float]:
    """Return the thresholds of the demand classes and the chassis, as members of `mpc_model`."""
    return {
        "class_hard_w": horizon.class_hard_w,
        "class_braking_w": horizon.class_braking_w,
        "rise_share": horizon.rise_share,
        "swing_share": horizon.swing_share,
        **vehicle.chassis.model_dump(),
    }


def fixed_block_s(horizon: HorizonSettings) -> int:
    """Return the length of a block, s; 0 if blocks share out what is ahead."""
    return 0 if horizon.blocks else horizon.block_s
