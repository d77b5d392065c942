"""PWA curves: their claimed error bounds, and the resulting errors of a trip."""

from collections.abc import Callable, Iterator

import numpy as np

from qpmpc.pwa import PwaFit, PwaModel
from qpmpc.vehicle import Vehicle
from qpmpc.verification.checks.check import Check
from qpmpc.verification.checks.context import Context, Loop
from qpmpc.verification.independent.equations import Equations, Floats

DENSE = 20_000
COARSE_FUEL_G_PER_S = 2e-6  # the fuel table is straight between 50 W
ROUNDING = 1e-9
TRIP_SHARE = 0.01
TRIP_SOC = 0.02

Curve = Callable[[Floats], Floats]


def curves_of(vehicle: Vehicle) -> dict[str, tuple[Curve, float, float, str, float]]:
    """Each fitted curve: its truth from the equations, range, unit and allowed rounding."""
    equations = Equations(vehicle)
    engine = vehicle.engine
    grid = np.arange(0.0, engine.power_max_w + 50.0, 50.0).clip(max=engine.power_max_w)
    table = equations.fuel_g_per_s(np.unique(grid))
    return {
        "fuel": (
            lambda p: np.interp(p, np.unique(grid), table),
            0.0,
            engine.power_max_w,
            "g/s",
            COARSE_FUEL_G_PER_S,
        ),
        "battery": (
            lambda p: equations.internal_w(vehicle.trip.soc_mean, p),
            -equations.charge_max_w,
            equations.discharge_max_w,
            "W",
            1e-6,
        ),
        "alpha": (equations.alpha, -20.0, 95.0, "", ROUNDING),
    }


def bounds_hold(context: Context) -> Iterator[Check]:
    """Fit minus curve stays within its bounds on a grid far finer than the fit's own samples."""
    for vehicle in context.vehicles:
        model = PwaModel.of(vehicle)
        for name, (truth, low, high, unit, rounding) in curves_of(vehicle).items():
            fit: PwaFit = getattr(model, name)
            x = np.unique(np.concatenate([np.linspace(low, high, DENSE), fit.breakpoints]))
            error = np.max(np.multiply.outer(x, fit.slope) + fit.intercept, axis=1) - truth(x)
            excess = max(float(error.max()) - fit.above, -float(error.min()) - fit.below, 0.0)
            yield Check(
                f"PWA bounds of {name}, {vehicle.name}",
                "The fitted curve stays within its two-sided error bounds.",
                rounding,
                excess,
                unit,
                f"{fit.pieces} pieces; claimed -{fit.below:.4g} .. +{fit.above:.4g}, measured "
                f"{error.min():+.4g} .. {error.max():+.4g} {unit}".rstrip(),
            )


def trip_error(loop: Loop, model: PwaModel, vehicle: Vehicle) -> tuple[float, float]:
    """Bounds of the PWA error of a trip: fuel in g and SOC.

    With the bounds e(P) of each piece about its curve, the largest |g - f| between the piece's
    breakpoints, and sums over the seconds of the closed loop,

        |fuel error| <= sum_on h [ alpha e_fuel(P_eng) + e_alpha f(P_eng) ]
        |SOC error| <= sum h e_battery(P_bat) / E_bat
    """
    equations, tr = Equations(vehicle), loop.run.trajectory
    spread = {}
    for name, (truth, low, high, _, _) in curves_of(vehicle).items():
        fit: PwaFit = getattr(model, name)
        x = np.linspace(low, high, DENSE)
        error = np.abs(fit(x) - truth(x))
        inner = fit.breakpoints[1:-1]
        piece = np.searchsorted(inner, x)
        worst = np.array([error[piece == i].max(initial=0.0) for i in range(fit.pieces)])
        at = {"fuel": tr.p_eng_w, "battery": tr.p_bat_w, "alpha": tr.t_cl_degc[:-1]}[name]
        spread[name] = worst[np.searchsorted(inner, at)]
    on = tr.engine_on
    burnt = equations.fuel_g_per_s(tr.p_eng_w)
    alpha = equations.alpha(tr.t_cl_degc[:-1])
    fuel_g = float(np.sum(on * (alpha * spread["fuel"] + spread["alpha"] * burnt)))
    return fuel_g, float(np.sum(spread["battery"])) / model.battery_energy_j


def trip_error_small(context: Context) -> Iterator[Check]:
    """Error bounds summed over closed-loop trips, as if all errors had the same sign."""
    model = PwaModel.of(context.vehicle)
    for loop in context.loops:
        fuel_g, soc = trip_error(loop, model, context.vehicle)
        yield Check(
            f"PWA error of a trip, fuel, {loop.name}",
            "The PWA errors of fuel and cold multiplier, all of one sign, cost less than this.",
            100.0 * TRIP_SHARE,
            100.0 * fuel_g / loop.run.fuel_g,
            "%",
            f"{fuel_g:.3f} g of {loop.run.fuel_g:.2f} g: sum of alpha e_f + e_alpha f",
        )
        yield Check(
            f"PWA error of a trip, SOC, {loop.name}",
            "The PWA errors of the battery, all of one sign, move SOC by less than this.",
            TRIP_SOC,
            soc,
            "",
            "sum of h e_battery / E_bat; feedback corrects it every second",
        )
