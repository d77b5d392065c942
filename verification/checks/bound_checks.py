"""The lower bound on a trip's fuel, dynamic programming and the controllers, in their order."""

from collections.abc import Iterator

from qpmpc.controllers.factory import ControllerSettings
from qpmpc.cycles import load_cycle
from qpmpc.results import Run
from qpmpc.runners import run
from qpmpc.verification.bounds.lower_bound import LowerBound, lower_bound, stored_energy_j
from qpmpc.verification.checks.check import Check
from qpmpc.verification.checks.context import Context
from qpmpc.verification.dynamic_programming import DpSettings

BRACKET_PERCENT = 1.0
CONTROLLERS = ("rule-based", "mh-qp-paper", "mh-qp")
ROUNDING_G = 1e-6


def bound_below_everything(context: Context) -> Iterator[Check]:
    """Bound <= DP <= every controller, with the width of the bracket."""
    for name in context.cycles:
        cycle = load_cycle(name)
        bound = lower_bound(cycle, context.vehicle)
        optimum = optimum_of(context, name)
        runs = [optimum, context.loop(name).run]
        if not context.quick:
            runs += [run(cycle, c, context.vehicle) for c in CONTROLLERS if c != "mh-qp"]
        for finished in runs:
            yield _below(bound, finished)
        yield Check(
            f"Bracket of the least fuel, {name}",
            "The lower bound is this close to dynamic programming.",
            BRACKET_PERCENT,
            100.0 * (optimum.fuel_g / bound.fuel_g - 1.0),
            "% of the bound",
            f"{bound.fuel_g:.3f} g <= least fuel <= {optimum.fuel_g:.3f} g (dp"
            f"{' on its quick grid' if context.quick else ''}); of the width, about "
            f"{bound.numerical_g:.3f} g is the bound's own interpolation",
        )


def optimum_of(context: Context, cycle: str) -> Run:
    """Dynamic programming on a cycle; in a quick run on its coarser grid."""
    settings = ControllerSettings(dp=DpSettings.quick()) if context.quick else context.settings
    return run(load_cycle(cycle), "dp", context.vehicle, settings)


def _below(bound: LowerBound, finished: Run) -> Check:
    soc, vehicle = finished.trajectory.soc, finished.vehicle
    used_j = stored_energy_j(vehicle, float(soc[0])) - stored_energy_j(vehicle, float(soc[-1]))
    priced_g = finished.fuel_g + bound.price_g_per_j * used_j
    return Check(
        f"Bound below {finished.controller}, {finished.cycle}",
        "Lower bound minus fuel, battery energy used at the bound's price, is not positive.",
        ROUNDING_G,
        bound.fuel_g - priced_g,
        "g",
        f"bound {bound.fuel_g:.3f} g, run {priced_g:.3f} g, "
        f"{100.0 * (priced_g / bound.fuel_g - 1.0):.2f} % above; final SOC {soc[-1]:.4f}",
    )
