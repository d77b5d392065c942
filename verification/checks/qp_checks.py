"""The QP: the same stages, problem and optimum as in the independent second version."""

from collections.abc import Iterator

import numpy as np

from qpmpc.preview import HorizonSettings, StageBuilder
from qpmpc.pwa import PwaModel
from qpmpc.qp import Linearisation, QpSettings, ScalingSettings, StageQp
from qpmpc.qp.stage_qp import QpData
from qpmpc.qp.structure import QpStructure
from qpmpc.solvers.base import Floats, QpSolution
from qpmpc.solvers.names import make_solver
from qpmpc.verification.checks.check import Check
from qpmpc.verification.checks.context import Context, Loop
from qpmpc.verification.independent.stage_program import (
    FUEL,
    Curves,
    StageProgram,
    expansion,
    horizon,
    shifted,
    stage_program,
)

EXACT = "piqp"
QUICK_SAMPLES, FULL_SAMPLES = 12, 60
AGREE = 1e-5  # relative fuel; solvers are set to 1e-8 in their own measures
REGULARISED = 5e-5  # relative fuel that the QP's quadratic regularisation may cost


def samples(context: Context, loop: Loop) -> list[int]:
    """Steps whose QPs are checked; in one of them at least the engine runs already."""
    spread = loop.sample(QUICK_SAMPLES if context.quick else FULL_SAMPLES)[1:]
    running = np.flatnonzero(loop.run.trajectory.engine_on[:-1])[:1] + 1
    return sorted({*spread, *running.tolist()})


def stages_agree(context: Context) -> Iterator[Check]:
    """Stages at many time steps against plain sums over the cycle."""
    for loop in context.loops:
        worst = 0.0
        for step in samples(context, loop):
            ours = loop.controller.planner.preview.source.at(step)
            theirs = horizon(loop.trip.cycle, loop.run.vehicle, loop.settings, step)
            pairs = (
                (ours.duration_s, theirs.h),
                (ours.net_w, theirs.net_w),
                (ours.speed_mps, theirs.speed_mps),
                (ours.internal_off_w, theirs.off_w),
                (ours.must_share, theirs.must),
                (ours.free_net_w, theirs.free_net_w),
                (ours.free_internal_off_w, theirs.free_off_w),
                (ours.rises, theirs.rises),
            )
            for a, b in pairs:
                worst = max(worst, float(np.max(np.abs(a - b)) / max(np.abs(b).max(), 1.0)))
        yield Check(
            f"Stages of the horizon, {loop.name}",
            "Times, P0, speeds, l(P0), seconds with a choice and rises are those of their seconds.",
            1e-9,
            worst,
            "relative",
        )


def _program(loop: Loop, curves: Curves, step: int) -> StageProgram:
    tr, vehicle = loop.run.trajectory, loop.run.vehicle
    running = step > 0 and bool(tr.engine_on[step - 1])
    state = (float(tr.soc[step]), float(tr.t_cl_degc[step]), running)
    about = expansion(loop.x(step - 1), loop.settings, state[1])
    off = np.flatnonzero(~tr.engine_on[:step])
    begun = step - 1 - (int(off[-1]) if len(off) else -1)
    held_s = vehicle.engine.min_on_s - begun if running else 0
    road = horizon(loop.trip.cycle, vehicle, loop.settings, step, held_s)
    return stage_program(vehicle, curves, loop.settings, road, state, about)


def same_optimum(context: Context) -> Iterator[Check]:
    """The recorded QP, solved exactly, against the same problem from equations, as an LP."""
    model = PwaModel.of(context.vehicle)
    curves = Curves(model.fuel, model.battery, model.alpha)
    for loop in context.loops:
        qp = loop.controller.planner.qp
        cost_error, violation, where, entries = 0.0, 0.0, "", 0.0
        gap = 0.0
        for step in samples(context, loop):
            program, data = _program(loop, curves, step), loop.solves[step].data
            solution = exact(qp.structure, data)
            x = data.scaling.primal(solution.primal)
            least, ours = program.least(), float(program.cost @ x)
            cost_error = max(cost_error, _relative(ours, least, program, x))
            off, row = program.violation(x)
            if off > violation:
                violation, where = off, row
            linear = data.q / data.scaling.column / data.scaling.cost
            size = float(np.abs(program.cost).max())
            entries = max(entries, float(np.abs(linear - program.cost).max()) / size)
            gap = max(gap, _duality_gap(data, solution))
        name = loop.name
        yield Check(
            f"Optimum of the QP, {name}",
            "The QP of a step and the linear program from the equations cost the same.",
            REGULARISED,
            cost_error,
            "relative",
            f"{len(samples(context, loop))} recorded QPs; the QP's regularisation is in this",
        )
        yield Check(
            f"Feasibility of the QP's solution, {name}",
            "The QP's solution keeps every row of the problem from the equations.",
            1e-6,
            violation,
            "relative",
            f"worst row: {where}" if where else "",
        )
        yield Check(
            f"Cost of the QP, {name}",
            "The QP's gradient, in grams per SI unit, is that of the equations.",
            1e-9,
            entries,
            "relative",
        )
        yield Check(
            f"Duals of the QP, {name}",
            "Primal and dual cost agree in grams, after both have been turned into SI units.",
            1e-5,
            gap,
            "relative",
        )


def exact(structure: QpStructure, data: QpData) -> QpSolution:
    """Solution by the reference backend."""
    solver = make_solver(EXACT, 1e-9)
    solver.setup(structure, data)
    return solver.solve(data, None, None, cold=True)


def _relative(ours: float, least: float, program: StageProgram, x: Floats) -> float:
    """Difference of costs in units of the fuel planned, at least 10 g."""
    size = max(float(np.abs(program.cost * x).reshape(program.stages, -1)[:, FUEL].sum()), 10.0)
    difference = abs(ours - least) / size
    return difference if np.isfinite(difference) else float("inf")


def _duality_gap(data: QpData, solution: QpSolution) -> float:
    """|c x + x P x + y_up u - y_low l| relative, all in g and SI units."""
    scale = data.scaling
    x, dual = scale.primal(solution.primal), scale.dual(solution.dual)
    cost = data.q / scale.column / scale.cost
    curvature = data.hessian / scale.column**2 / scale.cost
    above, below = np.maximum(dual, 0.0), np.maximum(-dual, 0.0)
    upper, lower = data.upper / scale.row, data.lower / scale.row
    upper, lower = (np.where(np.isfinite(v), v, 0.0) for v in (upper, lower))
    primal = float(cost @ x + x @ (curvature * x))
    return abs(primal + float(above @ upper - below @ lower)) / max(abs(primal), 10.0)


def warm_start_shifted(context: Context) -> Iterator[Check]:
    """Each step starts from the last solution, moved to the stages of the same seconds."""
    for loop in context.loops:
        worst = 0.0
        for step in samples(context, loop):
            scale, last = loop.solves[step].data.scaling, loop.solves[step - 1].data.scaling
            n = loop.controller.planner.preview.count
            start = loop.solves[step]
            if start.primal is None or start.dual is None:
                raise RuntimeError(f"step {step} has no warm start")
            duals = (loop.solves[step - 1].solution.dual * last.row / last.cost).reshape(n, -1)
            pairs = (
                (start.primal * scale.column, shifted(loop.x(step - 1), loop.settings).ravel()),
                (start.dual * scale.row / scale.cost, shifted(duals, loop.settings).ravel()),
            )
            for a, b in pairs:
                worst = max(worst, float(np.abs(a - b).max() / np.abs(b).max()))
        yield Check(
            f"Warm start, {loop.name}",
            "Primal and dual start are the last step's, carried over by identity, in SI units.",
            1e-9,
            worst,
            "relative",
        )


def scaling_is_neutral(context: Context) -> Iterator[Check]:
    """The optimum in SI units does not depend on the solver's units."""
    vehicle = context.vehicle
    loop = context.loop("nycc")
    model = PwaModel.of(vehicle)
    truth = loop.trip.truth
    preview = StageBuilder(vehicle, truth, truth, HorizonSettings())
    about = Linearisation.constant(preview.count, 48.0)
    fuels = []
    units = (
        ScalingSettings(),
        ScalingSettings(power_w=1e3, fuel_g_per_s=0.1, energy_j=10e3, t_cl_k=3.0),
        ScalingSettings(duration_exponent=1.0),
    )
    for unit in units:
        qp = StageQp(vehicle, model, preview.count, QpSettings(regularisation=1e-9), unit)
        data = qp.update(preview.at(100), 0.6, 50.0, about)
        x = data.scaling.primal(exact(qp.structure, data).primal)
        fuels.append(float((data.q / data.scaling.column / data.scaling.cost) @ x))
    yield Check(
        "Units of the solver",
        "The optimum's cost in grams is the same in three systems of solver units.",
        AGREE,
        float(np.ptp(fuels) / max(abs(fuels[0]), 1.0)),
        "relative",
    )
