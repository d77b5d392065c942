"""Processor in the loop: the firmware drives a cycle on the Python plant, checked by Python."""

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpmpc.closed_loop import drive
from qpmpc.codegen.controller import InputBuilder
from qpmpc.codegen.firmware import (
    STACK_RESERVED_BYTES,
    Footprint,
    Target,
    build_firmware,
    footprint,
)
from qpmpc.codegen.generate import Algorithm, Precision, algorithm_of
from qpmpc.codegen.method import Generated, Method
from qpmpc.controllers.base import Controller, Decision, Progress
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.results import Run
from qpmpc.trip import Observation, Trip
from qpmpc.vehicle.plant import Command

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
    command_w, reference_w : engine power commanded by the firmware, and by the Python controller
        in the same states, shape (steps,); 0 with the engine off
    command_on, reference_on : engine on or off, likewise
    flags : of each step
    footprint, state_bytes, stack_bytes : memory; of the stack the part really used
    steps_per_s : wall-clock speed of the whole loop
    """

    target: str
    algorithm: Algorithm
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
        """Variables and the stack used."""
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
            "algorithm": self.algorithm,
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


class OnTarget(Controller):
    """The firmware as a controller."""

    implementation = "c"
    has_monitor = has_safety_layer = True  # in the firmware

    def __init__(self, trip: Trip, method: Method, target: Target, label: str) -> None:
        self.name = method.name
        super().__init__(trip)
        self.solver_name, self._method = label, method
        self._target, self._inputs = target, InputBuilder(trip.preview(method.horizon).receive)
        self._in = target.input_type()
        self.departure_instructions: list[int] = []
        self.instructions: list[int] = []
        self.flags: list[int] = []
        self.stack_bytes = self.state_bytes = 0
        self.last_out: Any = None  # `mpc_out` of the last step

    def depart(self, progress: Progress | None = None) -> None:
        """Solve the first plan on the target, slice by slice."""
        self._target.init()
        left = int(self._method.prepared)
        self._inputs.fill(self.trip.start, self._in)
        while left > 0:
            answer = self._target.depart(self._in)
            self.departure_instructions.append(answer.instructions)
            left = answer.result

    def step(self, seen: Observation) -> Decision:
        """Get the command from the target."""
        self._inputs.fill(seen, self._in)
        answer = self._target.step(self._in)
        self.instructions.append(answer.instructions)
        self.flags.append(answer.result)
        self.last_out = answer.out
        self.stack_bytes, self.state_bytes = answer.stack_bytes, answer.state_bytes
        return self._method.decision(answer.out)


def processor_in_the_loop(
    trip: Trip,
    settings: ControllerSettings | None = None,
    precision: Precision = "f32",
    progress: Progress | None = None,
    algorithm: Algorithm = "admm",
    controller: Generated = "mh-qp",
) -> PilResult:
    """Drive a trip with the firmware in QEMU (mps2-an500, Cortex-M7) on the Python plant.

    Parameters
    ----------
    trip, settings : the trip to drive, and settings of the controllers
    precision : of the firmware
    progress : called as progress(steps done, steps in all)
    algorithm : of the QP, in the firmware
    controller : that the firmware is

    Raises
    ------
    CodegenError
        If a tool is missing, the firmware does not fit or does not answer.
    InputError
        If the settings do not fit generated code.
    """
    method = Method.of(controller, settings or ControllerSettings())
    values = method.values(trip.vehicle, method.horizon.block_count(trip.forecast.steps))
    algorithm = algorithm_of(values, algorithm)
    twin = method.twin(trip)
    commands: list[Command] = []
    references: list[Command] = []

    def compare(seen: Observation, decision: Decision) -> None:
        commands.append(decision.command)
        references.append(twin.decide(seen).command)

    with TemporaryDirectory(prefix="qpmpc-pil-") as scratch:
        folder = Path(scratch)
        elf = build_firmware(values, precision, folder, algorithm)
        with Target(elf, values, precision, folder) as target:
            label = f"{algorithm} {precision} on cortex-m7"
            firmware = OnTarget(trip, method, target, label)
            start = perf_counter()
            run = drive(trip, firmware, on_step=compare, progress=progress)
            seconds = perf_counter() - start
        memory = footprint(elf)
    return PilResult(
        target="cortex-m7",
        algorithm=algorithm,
        precision=precision,
        iterations=values.iterations,
        run=run,
        reference=drive(trip, method.twin(trip)),
        instructions=np.array(firmware.instructions),
        departure_instructions=np.array(firmware.departure_instructions, dtype=np.int64),
        command_w=np.array([c.p_eng_w for c in commands]),
        reference_w=np.array([c.p_eng_w for c in references]),
        command_on=np.array([c.engine_on for c in commands]),
        reference_on=np.array([c.engine_on for c in references]),
        flags=np.array(firmware.flags),
        footprint=memory,
        state_bytes=firmware.state_bytes,
        stack_bytes=firmware.stack_bytes,
        steps_per_s=trip.steps / seconds,
    )
