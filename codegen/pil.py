"""Processor in the loop: the firmware drives a cycle on the Python plant, watched by Python."""

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpmpc.codegen.controller import RUNGS, InputBuilder
from qpmpc.codegen.firmware import (
    STACK_RESERVED_BYTES,
    Footprint,
    Target,
    build_firmware,
    footprint,
)
from qpmpc.codegen.generate import Precision, Solver
from qpmpc.codegen.values import values_of
from qpmpc.controllers.base import Decision, Observation
from qpmpc.controllers.factory import ControllerSettings
from qpmpc.controllers.mh_qp import MhQp
from qpmpc.cycles import Cycle
from qpmpc.preview.forecast import Trace
from qpmpc.preview.stages import StageBuilder
from qpmpc.results import Run
from qpmpc.simulate import Progress, simulate
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.vehicle.plant import Command, Plant

Floats = NDArray[np.float64]
CLOCKS_MHZ = (80, 300, 480)
CYCLES_AN_INSTRUCTION = (1.0, 1.5, 2.5)


@dataclass
class PilResult:
    """A finished processor-in-the-loop run.

    Attributes
    ----------
    run : of the firmware on the Python plant
    reference : the Python controller's own closed loop on the same cycle
    instructions : of each step, shape (steps,)
    departure_instructions : of each slice before the trip
    command_w, reference_w : engine power asked by the firmware, and by the Python controller in
        the same states, shape (steps,); 0 with the engine off
    command_on, reference_on : engine on or off, likewise
    flags : of each step
    footprint, state_bytes, stack_bytes : memory; the stack is what was really used
    steps_per_s : wall-clock speed of the whole loop
    """

    target: str
    solver: Solver
    precision: Precision
    iterations: int
    run: Run
    reference: Run
    instructions: NDArray[np.int64]
    departure_instructions: NDArray[np.int64]
    command_w: Floats
    reference_w: Floats
    command_on: NDArray[np.bool_]
    reference_on: NDArray[np.bool_]
    flags: NDArray[np.int64]
    footprint: Footprint
    state_bytes: int
    stack_bytes: int
    steps_per_s: float

    @property
    def flips(self) -> NDArray[np.intp]:
        """Steps at which firmware and Python disagree about engine on or off."""
        return np.flatnonzero(self.command_on != self.reference_on)

    @property
    def command_error_w(self) -> Floats:
        """|Engine power of the firmware - that of Python in the same state|, shape (steps,)."""
        return np.abs(self.command_w - self.reference_w)

    @property
    def ram_bytes(self) -> int:
        """Variables and the stack that was used."""
        return self.footprint.ram_static + self.stack_bytes

    def summary(self) -> dict[str, Any]:
        """Return the figures as plain data, ready for JSON."""
        counts, error = self.instructions, self.command_error_w
        alike = self.command_on == self.reference_on
        median = float(np.median(counts))
        fuel, ours = self.reference.fuel_soc_balanced_g, self.run.fuel_soc_balanced_g
        summary = self.run.summary()
        return {
            "cycle": self.run.cycle,
            "target": self.target,
            "solver": self.solver,
            "precision": self.precision,
            "iterations": self.iterations,
            "steps": len(counts),
            "instructions": {
                "median": round(median),
                "min": int(counts.min()),
                "max": int(counts.max()),
                "spread_percent": float((counts.max() - counts.min()) / median * 100.0),
            },
            "departure": {
                "slices": len(self.departure_instructions),
                "instructions_max": int(self.departure_instructions.max(initial=0)),
                "instructions_sum": int(self.departure_instructions.sum()),
            },
            "milliseconds_estimated": [
                {
                    "clock_mhz": clock,
                    "cycles_per_instruction": cpi,
                    "milliseconds": float(counts.max() * cpi / clock * 1e-3),
                }
                for clock in CLOCKS_MHZ
                for cpi in CYCLES_AN_INSTRUCTION
            ],
            "flash_bytes": self.footprint.flash,
            "ram_bytes": self.ram_bytes,
            "state_bytes": self.state_bytes,
            "stack_bytes": self.stack_bytes,
            "stack_bytes_call_graph": self.footprint.stack_frames,
            "stack_bytes_reserved": STACK_RESERVED_BYTES,
            "max_command_error_w": float(error.max()),
            "max_command_error_w_same_engine_state": float(error[alike].max(initial=0.0)),
            "on_off_flips": [int(k) for k in self.flips],
            "fuel_g": summary["fuel_g"],
            "fuel_soc_balanced_g": ours,
            "fuel_soc_balanced_g_python": fuel,
            "fuel_difference_percent": (ours / fuel - 1.0) * 100.0,
            "violations": summary["violations"],
            "fallback_steps": summary["fallback_steps"],
            "steps_per_s": self.steps_per_s,
        }


class _OnTarget:
    """The firmware as a controller, with the Python controller deciding in the same states."""

    name = "mh-qp"

    def __init__(self, target: Target, inputs: InputBuilder, twin: MhQp, label: str) -> None:
        self.solver_name = label
        self._target, self._inputs, self._twin = target, inputs, twin
        self.in_ = target.input_type()
        self.instructions: list[int] = []
        self.flags: list[int] = []
        self.commands: list[Command] = []
        self.references: list[Command] = []
        self.stack_bytes = self.state_bytes = 0

    def decide(self, seen: Observation) -> Decision:
        """Ask the target, and the Python controller for comparison."""
        self._inputs.fill(seen, self.in_)
        answer = self._target.step(self.in_)
        out = answer.out
        command = Command(bool(out.engine_on), float(out.p_eng_w))
        self.instructions.append(answer.instructions)
        self.flags.append(answer.result)
        self.stack_bytes, self.state_bytes = answer.stack_bytes, answer.state_bytes
        self.commands.append(command)
        self.references.append(self._twin.decide(seen).command)
        planned = out.rung == 0
        gap, sigma = (out.relaxation_gap, out.on_share) if planned else (np.nan, np.nan)
        return Decision(command, RUNGS[out.rung], out.iterations, gap, sigma)


def processor_in_the_loop(
    cycle: Cycle,
    vehicle: Vehicle,
    settings: ControllerSettings | None = None,
    precision: Precision = "f32",
    progress: Progress | None = None,
    solver: Solver = "admm",
) -> PilResult:
    """Drive a cycle with the firmware in QEMU (mps2-an500, Cortex-M7) on the Python plant.

    Parameters
    ----------
    cycle, vehicle : the trip
    settings : of the controllers
    precision : of the firmware
    progress : called as progress(steps done, steps in all)
    solver : of the firmware

    Raises
    ------
    CodegenError
        If a tool is missing, the firmware does not fit or does not answer.
    InputError
        If the settings do not fit generated code.
    """
    settings = settings or ControllerSettings()
    of_mpc, plant, truth = settings.mh_qp, Plant(vehicle), Trace.of(cycle, vehicle)
    blocks = of_mpc.horizon.block_count(truth.steps)
    values = values_of(vehicle, of_mpc, settings.rule_based, blocks)
    preview = StageBuilder(vehicle, truth, truth, of_mpc.horizon)
    twin = MhQp("mh-qp", plant, truth, truth, of_mpc, settings.rule_based)
    with TemporaryDirectory(prefix="qpmpc-pil-") as scratch:
        folder = Path(scratch)
        elf = build_firmware(values, precision, folder, solver)
        with Target(elf, values, precision, folder) as target:
            label = f"generated {solver} {precision} on cortex-m7"
            firmware = _OnTarget(target, InputBuilder(preview, truth), twin, label)
            target.init()
            departure = _depart(target, firmware, vehicle, truth) if of_mpc.prepared else []
            start = perf_counter()
            run = simulate(cycle, firmware, vehicle, progress=progress)
            seconds = perf_counter() - start
        memory = footprint(elf)
    in_python = settings.with_settings({"mh_qp.solver": "osqp"})
    reference = simulate(cycle, "mh-qp", vehicle, settings=in_python)
    return PilResult(
        target="cortex-m7",
        solver=solver,
        precision=precision,
        iterations=values.iterations,
        run=run,
        reference=reference,
        instructions=np.array(firmware.instructions),
        departure_instructions=np.array(departure, dtype=np.int64),
        command_w=np.array([c.p_eng_w for c in firmware.commands]),
        reference_w=np.array([c.p_eng_w for c in firmware.references]),
        command_on=np.array([c.engine_on for c in firmware.commands]),
        reference_on=np.array([c.engine_on for c in firmware.references]),
        flags=np.array(firmware.flags),
        footprint=memory,
        state_bytes=firmware.state_bytes,
        stack_bytes=firmware.stack_bytes,
        steps_per_s=cycle.steps / seconds,
    )


def _depart(target: Target, firmware: _OnTarget, vehicle: Vehicle, truth: Trace) -> list[int]:
    """Let the target solve its first plan; returns the instructions of each slice."""
    trip = vehicle.trip
    demand_w, speed_mps = float(truth.demand_w[0]), float(truth.speed_mps[0])
    start = Observation(0, trip.soc_init, trip.t_cl_init_degc, False, demand_w, speed_mps)
    firmware._inputs.fill(start, firmware.in_)
    counts, left = [], 1
    while left > 0:
        answer = target.depart(firmware.in_)
        counts.append(answer.instructions)
        left = answer.result
    return counts
