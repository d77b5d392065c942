"""One grid: value function backwards, optimal trajectory forwards on the plant."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from math import ceil, sqrt

import numpy as np

from qpmpc.vehicle import Command, PlantState
from qpmpc.verification.dynamic_programming import kernels
from qpmpc.verification.dynamic_programming.grid import Grid
from qpmpc.verification.dynamic_programming.kernels import (
    Cells,
    Floats,
    Ints,
    Moves,
    Powers,
    Step,
)
from qpmpc.verification.dynamic_programming.power_limits import PowerLimits
from qpmpc.verification.dynamic_programming.problem import Problem
from qpmpc.verification.dynamic_programming.trajectory import Trajectory

Progress = Callable[[float], None]

NODES_WORTH_THREADS = 5_000
VALUES_BYTES = 400e6
"""Of the value functions kept: with `DpSettings.quick` all of a trip of two hours (300 MB), and
every second one of half an hour with the default; two processes then take about 1 GB."""


class Sweep:
    """Bellman recursion on one grid.

    The backward pass keeps W_k at every L-th time, see `segment_length`. The forward pass
    computes the values in between once more, segment by segment, as it needs them.
    """

    def __init__(self, problem: Problem, grid: Grid, threads: int) -> None:
        self.problem = problem
        self.grid = grid
        self.states = problem.states
        self.segment = segment_length(problem.steps, 8 * self.states.count * grid.nodes)
        self.same = self._same()
        rows = grid.soc.points
        parts = threads if grid.nodes >= NODES_WORTH_THREADS else 1
        bounds = np.linspace(0, rows, parts + 1).astype(int).tolist()
        self.chunks = list(pairwise(bounds))
        self.coast = kernels.coasting_set(
            problem.maps,
            problem.constants,
            problem.demand_w,
            problem.speed_mps,
            problem.off_allowed,
            problem.soc_end,
        )

    def run(self, progress: Progress) -> Trajectory:
        """Solve and roll out; `progress` receives the finished fraction."""
        n, segment = self.problem.steps, self.segment
        shape = (self.states.count, *self.grid.shape)
        total, done = 2 * n - len(range(0, n, segment)), 0
        with ThreadPoolExecutor(len(self.chunks)) as pool:
            value = np.zeros(shape)
            kept = {n: value}
            for k in range(n - 1, -1, -1):
                value = self._backward(pool, k, value)
                if k % segment == 0:
                    kept[k] = value
                done += 1
                progress(done / total)
            forward = _Forward(self)
            for start in range(0, n, segment):
                stop = min(start + segment, n)
                values = {start: kept[start], stop: kept[stop]}
                for k in range(stop - 1, start, -1):
                    values[k] = self._backward(pool, k, values[k + 1])
                    done += 1
                    progress(done / total)
                for k in range(start, stop):
                    forward.step(k, values[k], values[k + 1])
        progress(1.0)
        return forward.result()

    def step(self, k: int) -> Step:
        """Gather the data of step k."""
        problem = self.problem
        soc, t_cl = self.coast
        return Step(
            float(problem.demand_w[k]),
            float(problem.speed_mps[k]),
            _powers(False, problem.running, k),
            _powers(True, problem.starting, k),
            bool(problem.off_allowed[k]),
            k == problem.steps - 1,
            float(soc[k + 1]),
            float(t_cl[k + 1]),
        )

    def moves(self, k: int) -> Moves:
        """Gather where step k leads the engine."""
        states = self.states
        return Moves(
            states.rests,
            states.is_start,
            states.on_next,
            states.off_next,
            states.most_w,
            states.may_end,
            self.same[k],
        )

    def powers_w(self, k: int) -> list[Floats]:
        """Engine powers tried in step k: of an engine that ran, and of one that starts."""
        problem = self.problem
        limits = (problem.running, problem.starting)[: min(self.states.count, 2)]
        return [self.grid.powers_w(each, self.states, k) for each in limits]

    def _same(self) -> list[Ints]:
        problem, last = self.problem, self.states.count - 1
        numbers = np.arange(last + 1)
        # nothing follows the last step
        same = [np.where(numbers < self.states.rests, numbers, last)]
        for k in range(problem.steps - 1, -1, -1):
            same.append(self.states.same_as(float(problem.running.high_w[k]), same[-1]))
        return same[::-1]

    def coasts(self, k: int, soc: float, t_cl_degc: float) -> bool:
        """Tell whether the rest of the cycle is driven with the engine off from this state."""
        slack = 0.1 * kernels.MARGIN
        return bool(soc >= self.coast[0][k] - slack and t_cl_degc >= self.coast[1][k] - slack)

    def _backward(self, pool: ThreadPoolExecutor, k: int, following: Floats) -> Floats:
        problem, grid, step = self.problem, self.grid, self.step(k)
        soc_axis, t_axis = grid.soc.nodes(k), grid.t_cl.nodes(k)
        target = grid.lattice(k + 1)
        powers_w = self.powers_w(k)
        counts = np.array([1 + len(each) for each in powers_w])  # off is number 0
        power_w: Floats = np.zeros((len(counts), counts.max()))
        for s, each in enumerate(powers_w):
            power_w[s, 1 : counts[s]] = each
        table = (*power_w.shape, len(t_axis))
        fuel: Floats = np.empty(table)
        weight: Floats = np.empty(table)
        column: Cells = np.empty(table, dtype=np.uint32)
        run_end: Cells = np.empty(table, dtype=np.uint32)
        kernels.temperature_tables(
            problem.maps,
            problem.constants,
            step.speed_mps,
            power_w,
            counts,
            t_axis,
            target.t_cl,
            fuel,
            column,
            weight,
            run_end,
        )
        moves = self.moves(k)
        value = np.empty_like(following)

        def rows(first: int, stop: int) -> None:
            kernels.bellman_rows(
                first, stop, problem.maps, problem.constants, step, moves, power_w, counts,
                soc_axis, t_axis, target, fuel, column, weight, run_end, following, value,
            )  # fmt: skip

        jobs = [pool.submit(rows, *chunk) for chunk in self.chunks[1:]]
        rows(*self.chunks[0])
        for job in jobs:
            job.result()
        return value


def _powers(is_start: bool, limits: PowerLimits, k: int) -> Powers:
    return Powers(
        is_start, bool(limits.allowed[k]), float(limits.low_w[k]), float(limits.high_w[k])
    )


def segment_length(steps: int, value_bytes: int) -> int:
    """Return the least L whose value functions fit into VALUES_BYTES.

    Every L-th of n and the L - 1 in between at one time make n/L + L; where even the least of
    these, at sqrt(n), does not fit, that is taken.
    """
    least = max(1, ceil(sqrt(steps)))
    fitting = (
        length
        for length in range(1, least)
        if (ceil(steps / length) + length) * value_bytes <= VALUES_BYTES
    )
    return next(fitting, least)


class _Forward:
    """The plant, driven step by step by the policy that the value function implies."""

    def __init__(self, sweep: Sweep) -> None:
        problem = sweep.problem
        n = problem.steps
        self.sweep = sweep
        self.state = PlantState(problem.soc_init, problem.t_cl_init_degc)
        self.soc, self.t_cl_degc = np.empty(n + 1), np.empty(n + 1)
        self.engine_on = np.zeros(n, dtype=np.bool_)
        self.p_eng_w, self.fuel_g = np.zeros(n), np.zeros(n)
        self.soc_costate, self.t_cl_costate = np.zeros(n), np.zeros(n)
        self.value_g = 0.0
        self.admissible = True

    def step(self, k: int, value: Floats, following: Floats) -> None:
        sweep, state = self.sweep, self.state
        problem, grid = sweep.problem, sweep.grid
        soc, t_cl = state.soc, state.t_cl_degc
        self.soc[k], self.t_cl_degc[k] = soc, t_cl
        number = sweep.states.number(state)
        if sweep.coasts(k, soc, t_cl) and sweep.states.may_stop(number):
            command, admissible = Command(False, 0.0), True
            # only the final-SOC constraint holds the state here: its multiplier does not change
            self.soc_costate[k] = self.soc_costate[k - 1] if k > 0 else 0.0
        else:
            step = sweep.step(k)
            cost, on, power, admissible = kernels.best_command(
                problem.maps,
                problem.constants,
                step,
                sweep.moves(k),
                number,
                problem.ramped_w(state),
                sweep.powers_w(k)[1 if sweep.states.is_start[number] else 0],
                soc,
                t_cl,
                following,
                grid.lattice(k + 1),
            )
            command = Command(on, power)
            if k == 0:
                self.value_g = cost
            lattice = grid.lattice(k)
            by_soc, by_t_cl = kernels.gradient(value, number, lattice, soc, t_cl)
            self.soc_costate[k] = -by_soc
            self.t_cl_costate[k] = -by_t_cl
        self.state, flows = problem.plant.step(
            state, command, float(problem.demand_w[k]), float(problem.speed_mps[k])
        )
        self.engine_on[k], self.p_eng_w[k] = command.engine_on, flows.p_eng_w
        self.fuel_g[k] = flows.fuel_g
        off_too_fast = not command.engine_on and bool(problem.too_fast[k])
        self.admissible &= admissible and flows.power_excess_w == 0.0 and not off_too_fast

    def result(self) -> Trajectory:
        self.soc[-1], self.t_cl_degc[-1] = self.state.soc, self.state.t_cl_degc
        return Trajectory(
            self.soc,
            self.t_cl_degc,
            self.engine_on,
            self.p_eng_w,
            self.fuel_g,
            self.soc_costate,
            self.t_cl_costate,
            self.value_g,
            self.admissible,
        )
