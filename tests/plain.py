"""A car without winter's extras, for tests that add one of them, or look at something else."""

from qpmpc.vehicle import Vehicle, load_vehicle

ENGINE_LIMITS = ("start_fuel_g", "start_energy_j", "min_on_s", "min_off_s", "ramp_w_per_s")


def plain_car(paper: str = "paper-nimh") -> Vehicle:
    """A car of the paper, with starts, shortest runs and the ramp of the default.

    Its road load is that of 24 C in any weather, its brakes give all to the battery, which is not
    weaker in the cold, and any speed may be driven electrically.
    """
    engine = load_vehicle().engine
    limits = {f"engine.{name}": getattr(engine, name) for name in ENGINE_LIMITS}
    return load_vehicle(paper).with_settings(limits)
