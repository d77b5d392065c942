"""Coarse grid, then a tube around its trajectory."""

from collections.abc import Callable

import numpy as np

from qpmpc.cycles import Cycle
from qpmpc.vehicle import Vehicle
from qpmpc.verification.dynamic_programming.grid import Grid
from qpmpc.verification.dynamic_programming.problem import Problem, build_problem
from qpmpc.verification.dynamic_programming.settings import DpSettings
from qpmpc.verification.dynamic_programming.solution import CLEARANCE, DpLevel, DpSolution
from qpmpc.verification.dynamic_programming.sweep import Sweep
from qpmpc.verification.dynamic_programming.trajectory import Trajectory

MOVES = 6
MOVES_BEFORE_WIDENING = 2
WIDENING = 1.5
LARGEST_J = 6e6
"""Energy of the whole battery up to which cells in SOC are taken as they are set."""


def solve(
    cycle: Cycle,
    vehicle: Vehicle,
    settings: DpSettings,
    threads: int,
    progress: Callable[[float], None],
) -> DpSolution:
    """Solve all levels; see `solve_dp` of this package."""
    problem = build_problem(cycle, vehicle)
    soc_step, t_cl_step_k, power, _ = settings.cells
    part = _part_of_soc(problem)
    soc_step *= part
    coarse = Grid.full(problem, soc_step, t_cl_step_k, power)
    *half_width, refinement = settings.tube(cycle.duration_s)
    width = (half_width[0] * part, half_width[1])
    fine = (soc_step / refinement, t_cl_step_k / refinement)
    levels = []

    def run(grid: Grid, begin: float, end: float) -> Trajectory:
        reached = 0.0

        def report(fraction: float) -> None:
            nonlocal reached
            if fraction - reached >= 0.005 or fraction == 1.0:
                reached = fraction
                progress(begin + (end - begin) * fraction)

        path = Sweep(problem, grid, threads).run(report)
        levels.append(_level(grid, path))
        return path

    if refinement == 1:
        return _solution(cycle, problem, run(coarse, 0.0, 1.0), levels)
    # the tube has at first about this many nodes, and work is in proportion
    tube_nodes = 4.0 * width[0] * width[1] / (fine[0] * fine[1])
    done = coarse.nodes / (coarse.nodes + tube_nodes)
    path = run(coarse, 0.0, done)
    for move in range(MOVES):
        grid = Grid.around(problem, path, width, fine, power)
        # most tubes need not move: leave a fifth of what is left of the bar to those that do
        upto = 1.0 if move == MOVES - 1 else done + 0.8 * (1.0 - done)
        path = run(grid, done, upto)
        done = upto
        if levels[-1].clearance >= CLEARANCE:
            break
        if move >= MOVES_BEFORE_WIDENING:
            width = (width[0] * WIDENING, width[1] * WIDENING)
    progress(1.0)
    return _solution(cycle, problem, path, levels)


def _part_of_soc(problem: Problem) -> float:
    """What cells and tube are of the SOC that they are set to: 1, less with a large battery.

    There a cell of a plug-in's SOC holds as much energy as one of a battery of `LARGEST_J`.
    """
    vehicle = problem.plant.vehicle
    return min(1.0, LARGEST_J / problem.plant.battery.energy_j(vehicle.trip.soc_mean))


def _level(grid: Grid, path: Trajectory) -> DpLevel:
    return DpLevel(
        *grid.shape,
        grid.soc.spacing,
        grid.t_cl.spacing,
        grid.power_step_w,
        float(path.fuel_g.sum()),
        path.value_g,
        min(grid.soc.clearance(path.soc), grid.t_cl.clearance(path.t_cl_degc)),
    )


def _solution(
    cycle: Cycle, problem: Problem, path: Trajectory, levels: list[DpLevel]
) -> DpSolution:
    vehicle, battery = problem.plant.vehicle, problem.plant.battery
    energy_j = battery.open_circuit(path.soc[:-1]) * battery.charge_c
    with np.errstate(divide="ignore"):
        efficiency = energy_j / (path.soc_costate_g * problem.constants.lhv_j_per_g)
    return DpSolution(
        cycle=cycle.name,
        vehicle=vehicle.name,
        soc=path.soc,
        t_cl_degc=path.t_cl_degc,
        engine_on=path.engine_on,
        p_eng_w=path.p_eng_w,
        fuel_g=path.fuel_g,
        soc_costate_g=path.soc_costate_g,
        soc_efficiency=efficiency,
        t_cl_costate_g_per_k=path.t_cl_costate_g_per_k,
        heat_costate_g_per_mj=1e6
        * path.t_cl_costate_g_per_k
        / problem.constants.heat_capacity_j_per_k,
        levels=tuple(levels),
        admissible=path.admissible,
    )
