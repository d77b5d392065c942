"""The generated C controller behind the Python API of any controller."""

import ctypes
from collections.abc import Callable, Mapping
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpmpc.codegen.generate import Precision
from qpmpc.codegen.host_library import build_host_library
from qpmpc.codegen.values import Values, values_of
from qpmpc.controllers.base import Controller, Decision, Progress, Receive
from qpmpc.controllers.monitor import Flag
from qpmpc.controllers.settings import ControllerSettings, MhQpSettings
from qpmpc.preview.horizon import HorizonSettings
from qpmpc.pwa.model import PwaModel
from qpmpc.qp.expectation import expectation
from qpmpc.trip import Observation, Trip
from qpmpc.vehicle.plant import Command

Floats = NDArray[np.float64]
RUNGS = ("", "shifted plan", "rule-based")


class InputBuilder:
    """Fills the C controller's input from a trip, as a navigation system would.

    Parameters
    ----------
    receive : returns the preview of a second; the C code checks it
    """

    def __init__(self, receive: Receive) -> None:
        self.receive = receive

    def fill(self, seen: Observation, into: Any) -> None:
        """Write all inputs of one step."""
        into.soc, into.t_cl_degc = seen.soc, seen.t_cl_degc
        into.demand_w, into.speed_mps = seen.demand_w, seen.speed_mps
        into.engine_on, into.second = int(seen.engine_on), seen.step
        into.fuel_g = seen.fuel_g  # a field of C where it is read
        preview = self.receive(seen.step)
        into.short_count = preview.short_count
        into.short_demand_w[:] = preview.short_demand_w.tolist()
        into.short_speed_mps[:] = preview.short_speed_mps.tolist()
        long = preview.long
        into.long_duration_s[:] = long.duration_s.tolist()
        into.long_net_w[:] = long.net_w.tolist()
        into.long_speed_mps[:] = long.speed_mps.tolist()
        into.long_internal_off_w[:] = long.internal_off_w.tolist()
        into.long_must_share[:] = long.must_share.tolist()
        into.long_free_net_w[:] = long.free_net_w.tolist()
        into.long_free_internal_off_w[:] = long.free_internal_off_w.tolist()
        into.long_rises[:] = long.rises.tolist()
        into.long_fall_j[:] = long.fall_j.tolist()
        into.long_rise_j[:] = long.rise_j.tolist()
        into.short_rise_j = preview.short_rise_j


class GeneratedController(Controller):
    """The whole controller in C on this machine, for one trip; several may run side by side.

    Parameters
    ----------
    trip, settings : as of `Controller`
    of_qp : settings of the QP; those of `mh_qp` if None
    precision : of all arithmetic
    name : used in reports

    Attributes
    ----------
    inputs : fills in the C code's input each second
    fill_s, call_s : wall time of the last step, s: of filling in its input, and of the C call

    Raises
    ------
    InputError
        If the settings do not fit generated code, see `values_of`.
    CodegenError
        If it cannot be built.
    """

    implementation = "c"
    has_monitor = has_safety_layer = True  # in C

    def __init__(
        self,
        trip: Trip,
        settings: ControllerSettings | None = None,
        of_qp: MhQpSettings | None = None,
        precision: Precision = "f64",
        name: str = "mh-qp",
    ) -> None:
        super().__init__(trip, settings)
        self.of_qp = of_qp or self.settings.mh_qp
        self.name, self.solver_name = name, f"admm {precision}"
        blocks = self.of_qp.horizon.block_count(trip.forecast.steps)
        rules, section = self.settings.rule_based, name.replace("-", "_")
        values = values_of(trip.vehicle, self.of_qp, rules, blocks, section)
        self.reads_fuel = self.of_qp.learning
        model = PwaModel.of(trip.vehicle, self.of_qp.pwa, self.of_qp.learning)
        self._build(values, precision, self.of_qp.horizon, model, self.of_qp.prepared)

    def _build(
        self,
        values: Values,
        precision: Precision,
        horizon: HorizonSettings,
        model: PwaModel,
        prepared: bool,
    ) -> None:
        """Build the library, and its state; `prepared`: solve before the trip."""
        self._horizon, self._model, self._prepared = horizon, model, prepared
        self.library = self._normal = build_host_library(values, precision)
        self.remarks += filter(None, [self.library.remark])
        self.fill_s = self.call_s = 0.0
        self._preview = self.trip.preview(horizon)
        self._receive = self._preview.receive
        self.inputs = InputBuilder(self._receive)
        self._state = ctypes.create_string_buffer(self.library.state_bytes)
        self._calibrated: dict[str, float] = {}
        self._in, self._out = self.library.input_type(), self.library.output_type()
        self._arguments = (self._state, ctypes.byref(self._in), ctypes.byref(self._out))

    def depart(self, progress: Progress | None = None) -> None:
        """Set a defined state; prepare the first plan, unless the settings disable that."""
        self.forget()
        self.expects = None
        if self._prepared:
            self.inputs.fill(self.trip.start, self._in)
            while (left := self.library.depart(self._state, ctypes.byref(self._in))) > 0:
                pass
            if left == 0:
                stages, x = self._preview.at(self.trip.start.step), self.plan()[0]
                self.expects = expectation(self.trip, self._horizon, self._model, stages, x)

    def step(self, seen: Observation) -> Decision:
        """Run one step in C."""
        start = perf_counter()
        self.inputs.fill(seen, self._in)
        filled = perf_counter()
        if self.library.solver_may_succeed is not None:
            self.library.solver_may_succeed.value = not self.solver_fails
        self.library.step(*self._arguments)
        self.fill_s, self.call_s = filled - start, perf_counter() - filled
        return self._decision()

    def _decision(self) -> Decision:
        return decision_of(self._out)

    def inject(
        self, hearing: Callable[[Receive], Receive] | None, solver: bool = False
    ) -> frozenset[str]:
        """Prepare for faults, that of the solver in a library of its own.

        See `Controller.inject`.
        """
        normal = self._normal
        self.library = (
            build_host_library(normal.values, normal.precision, may_fail=True) if solver else normal
        )
        self.inputs.receive = self._receive if hearing is None else hearing(self._receive)
        return frozenset({"preview", "solver"})

    def forget(self) -> None:
        """Forget plan, warm start and the rules' memory, as after a restart of the ECU."""
        self.library.init(self._state)
        self.library.calibrate(self._state, self._calibrated)

    def calibrate(self, numbers: Mapping[str, float]) -> None:
        """Change numbers of the calibration from the next second on; they are kept after a restart.

        Parameters
        ----------
        numbers : by name, in SI units, see docs/calibration.md. A value out of bounds is refused
            in C: `Flag.BAD_CALIBRATION`, and all numbers stay as they were

        Raises
        ------
        InputError
            If there is no such number.
        """
        self.library.calibrate(self._state, numbers)
        self._calibrated |= numbers

    def plan(self) -> tuple[Floats, Floats]:
        """Return the last solution in SI units: variables (n, variables), duals (n, rows)."""
        values = self.library.values
        stages = values.sizes.stages
        x = (self.library.real * (stages * values.variables))()
        duals = (self.library.real * (stages * values.row_count))()
        self.library.plan(self._state, x, duals)
        return (
            np.array(x, dtype=float).reshape(stages, -1),
            np.array(duals, dtype=float).reshape(stages, -1),
        )


def decision_of(out: Any) -> Decision:
    """Return the content of an `mpc_out`."""
    planned = out.rung == 0
    return Decision(
        Command(bool(out.engine_on), float(out.p_eng_w)),
        RUNGS[out.rung],
        out.iterations,
        float(out.relaxation_gap) if planned else float("nan"),
        float(out.on_share) if planned else float("nan"),
        Flag(out.flags),
    )
