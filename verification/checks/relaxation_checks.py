"""The relaxation of on/off and the expansion of alpha(T) F, measured along closed loops."""

from collections.abc import Iterator

import numpy as np

from qpmpc.verification.checks.check import Check
from qpmpc.verification.checks.context import Context, Loop
from qpmpc.verification.independent.equations import Equations
from qpmpc.verification.independent.stage_program import FUEL, T_CL, expansion

INTEGRAL = 0.02
GAP_MEAN, INTEGRAL_SHARE, EXPANSION_SHARE = 0.04, 0.85, 0.005


def relaxation_tight(context: Context) -> Iterator[Check]:
    """Gap of the relaxed inequalities and integrality of the on-share, as applied."""
    for loop in context.loops:
        tr = loop.run.trajectory
        gap, sigma = tr.relaxation_gap, tr.on_share
        yield Check(
            f"Relaxation gap, {loop.name}",
            "Fuel and battery inequalities are tight at the applied stage, in the mean.",
            100.0 * GAP_MEAN,
            100.0 * float(np.mean(gap)),
            "%",
            f"largest {100.0 * float(gap.max()):.2f} %, at {context.settings.mh_qp.admm.iterations}"
            " iterations per step",
        )
        integral = float(np.mean((sigma < INTEGRAL) | (sigma > 1.0 - INTEGRAL)))
        yield Check(
            f"Integral on-share, {loop.name}",
            f"The on-share of the applied stage is within {INTEGRAL:g} of 0 or 1.",
            100.0 * INTEGRAL_SHARE,
            100.0 * integral,
            "% of steps",
            f"{int(np.sum((sigma >= INTEGRAL) & (sigma <= 1.0 - INTEGRAL)))} of {len(sigma)} "
            "steps were rounded",
            at_least=True,
        )


def expansion_error(loop: Loop, step: int) -> tuple[float, float]:
    """Fuel of a plan, g: |sum h (alpha(T) F - expansion)| over the stages, and the fuel itself.

    alpha is the exact curve here, so that this holds the error of its PWA fit as well.
    """
    equations, controller = Equations(loop.run.vehicle), loop.controller
    measured = float(loop.run.trajectory.t_cl_degc[step])
    x = loop.x(step)
    about_t, about_f, *_ = expansion(loop.x(step - 1), loop.settings, measured)
    ends = x[:, T_CL]
    mean = 0.5 * (ends + np.concatenate([[measured], ends[:-1]]))
    h = controller.planner.preview.source.at(step).duration_s
    curve = controller.planner.qp.model.alpha
    expanded = curve(about_t) * x[:, FUEL] + curve.active_slope(about_t) * about_f * (
        mean - about_t
    )
    exact = equations.alpha(mean) * x[:, FUEL]
    return abs(float(np.sum(h * (expanded - exact)))), float(np.sum(h * np.abs(exact)))


def expansion_small(context: Context) -> Iterator[Check]:
    """One linearisation per step is enough: the expansion is exact to second order."""
    for loop in context.loops:
        errors = [expansion_error(loop, k) for k in range(1, loop.trip.steps)]
        burning = [(error, fuel) for error, fuel in errors if fuel > 1.0]
        shares = [100.0 * error / fuel for error, fuel in burning]
        yield Check(
            f"Expansion of alpha(T) F, {loop.name}",
            "Expanding alpha(T) F about the last plan misses the plan's fuel by less, in the mean.",
            100.0 * EXPANSION_SHARE,
            float(np.mean(shares)),
            "%",
            f"99th percentile {np.percentile(shares, 99):.3f} %, largest {max(shares):.3f} %, "
            f"over {len(shares)} plans that burn more than 1 g",
        )
