"""The lower bound on a trip's fuel, dynamic programming and the controllers, in their order."""

from collections.abc import Iterator

from qpmpc.closed_loop import drive
from qpmpc.controllers.balance import rule_based
from qpmpc.controllers.mh_qp import mh_qp_paper
from qpmpc.controllers.receding_horizon import RecedingHorizon
from qpmpc.results import Run
from qpmpc.verification.bounds.lower_bound import LowerBound, lower_bound, stored_energy_j
from qpmpc.verification.checks.check import Check
from qpmpc.verification.checks.context import Context
from qpmpc.verification.dynamic_programming import DpSettings
from qpmpc.verification.dynamic_programming.controller import Dp

BRACKET_PERCENT = 1.0
ROUNDING_G = 1e-6


def bound_below_everything(context: Context) -> Iterator[Check]:
    """Bound <= DP <= every controller, with the width of the bracket."""
    for name in context.cycles:
        trip, settings = context.trip(name), context.settings
        bound = lower_bound(trip.cycle, context.vehicle)
        optimum = optimum_of(context, name)
        runs = [optimum, context.loop(name).run]
        if not context.quick:
            paper = RecedingHorizon(trip, mh_qp_paper(trip, settings))
            runs += [drive(trip, driver) for driver in (rule_based(trip, settings), paper)]
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
    grid = DpSettings.quick() if context.quick else DpSettings()
    trip = context.trip(cycle)
    return drive(trip, Dp(trip, context.settings.with_section("dp", grid)))


def _below(bound: LowerBound, finished: Run) -> Check:
    soc, vehicle = finished.trajectory.soc, finished.vehicle
    used_j = stored_energy_j(vehicle, vehicle.trip.soc_target) - stored_energy_j(
        vehicle, float(soc[-1])
    )
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
