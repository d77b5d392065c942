"""The generated C controller behind the Python API of any controller."""

import ctypes
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from qpmpc.codegen.generate import Precision
from qpmpc.codegen.host_library import VARS, HostLibrary, build_host_library
from qpmpc.codegen.values import values_of
from qpmpc.controllers.base import Decision, Observation
from qpmpc.controllers.factory import ControllerSettings
from qpmpc.preview.forecast import Trace
from qpmpc.preview.stages import StageBuilder
from qpmpc.vehicle.plant import Command, Plant

Floats = NDArray[np.float64]
RUNGS = ("", "shifted plan", "rule-based")
FLAGS = {1: "bad measurement", 2: "bad preview", 4: "solver failed", 8: "warming up"}


class Inputs(Protocol):
    """Whatever fills in the C controller's input."""

    def fill(self, seen: Observation, into: Any) -> None:
        """Write all inputs of one step."""


class InputBuilder:
    """Fills the C controller's input from a trip, as a navigation system would.

    Parameters
    ----------
    preview : cuts the trip into stages
    truth : what the short horizon sees
    """

    def __init__(self, preview: StageBuilder, truth: Trace) -> None:
        self._preview = preview
        self._steps = truth.steps
        self._short = preview.settings.short_stages
        padding = np.zeros(self._short)
        self._demand_w = np.concatenate([truth.demand_w, padding])
        self._speed_mps = np.concatenate([truth.speed_mps, padding])

    def fill(self, seen: Observation, into: Any) -> None:
        """Write all inputs of one step."""
        stages, now, n = self._preview.at(seen.step), seen.step, self._short
        into.soc, into.t_cl_degc = seen.soc, seen.t_cl_degc
        into.demand_w, into.speed_mps = seen.demand_w, seen.speed_mps
        into.short_count = min(n, self._steps - now)
        into.short_demand_w[:] = self._demand_w[now : now + n].tolist()
        into.short_speed_mps[:] = self._speed_mps[now : now + n].tolist()
        long = len(stages.duration_s) - n
        into.long_duration_s[:long] = stages.duration_s[n:].tolist()
        into.long_net_w[:long] = stages.net_w[n:].tolist()
        into.long_speed_mps[:long] = stages.speed_mps[n:].tolist()
        into.long_internal_off_w[:long] = stages.internal_off_w[n:].tolist()


class GeneratedController:
    """One controller of a loaded library; several may run side by side.

    Parameters
    ----------
    library : loaded
    inputs : fills the input of each step
    start : of the trip, to prepare the first plan; None: the rules drive while it warms up
    """

    name = "mh-qp"

    def __init__(self, library: HostLibrary, inputs: Inputs, start: Observation | None) -> None:
        self.solver_name = f"generated {library.precision}"
        self.library = library
        self._inputs = inputs
        self._state = ctypes.create_string_buffer(library.state_bytes)
        self._in, self._out = library.input_type(), library.output_type()
        self._arguments = (self._state, ctypes.byref(self._in), ctypes.byref(self._out))
        library.init(self._state)
        if start is not None:
            inputs.fill(start, self._in)
            while library.depart(self._state, ctypes.byref(self._in)) > 0:
                pass

    def decide(self, seen: Observation) -> Decision:
        """Run one step in C."""
        self.fill(seen)
        return self.step()

    def fill(self, seen: Observation) -> None:
        """Write the input of the next step."""
        self._inputs.fill(seen, self._in)

    def step(self) -> Decision:
        """Run one step in C on the input as it stands."""
        self.library.step(*self._arguments)
        out = self._out
        planned = out.rung == 0
        return Decision(
            Command(bool(out.engine_on), out.p_eng_w),
            RUNGS[out.rung],
            out.iterations,
            out.relaxation_gap if planned else float("nan"),
            out.sigma if planned else float("nan"),
        )

    def reset(self) -> None:
        """Forget plan, warm start and the rules' memory, as after a restart of the ECU."""
        self.library.init(self._state)

    def plan(self) -> tuple[Floats, Floats]:
        """Return the last solution in SI units: variables (n, 7), duals (n, rows)."""
        sizes = self.library.values.sizes
        x = (self.library.real * (sizes.stages * VARS))()
        duals = (self.library.real * (sizes.stages * sizes.rows))()
        self.library.plan(self._state, x, duals)
        return (
            np.array(x, dtype=float).reshape(sizes.stages, VARS),
            np.array(duals, dtype=float).reshape(sizes.stages, sizes.rows),
        )


def generated_controller(
    plant: Plant,
    truth: Trace,
    forecast: Trace | None = None,
    settings: ControllerSettings | None = None,
    precision: Precision = "f64",
) -> GeneratedController:
    """Make the `mh-qp` controller for one trip, in C on this machine.

    Parameters
    ----------
    plant : vehicle and its maps
    truth, forecast : what the short and the long horizon see; the truth if None
    settings : of the controllers
    precision : of all arithmetic

    Raises
    ------
    InputError
        If the settings do not fit generated code, see `values_of`.
    CodegenError
        If it cannot be built.
    """
    settings = settings or ControllerSettings()
    forecast = forecast or truth
    of_mpc, vehicle = settings.mh_qp, plant.vehicle
    preview = StageBuilder(vehicle, truth, forecast, of_mpc.horizon)
    blocks = of_mpc.horizon.block_count(forecast.steps)
    library = build_host_library(values_of(vehicle, of_mpc, settings.rule_based, blocks), precision)
    start = None
    if of_mpc.prepared:
        trip = vehicle.trip
        demand_w, speed_mps = float(truth.demand_w[0]), float(truth.speed_mps[0])
        start = Observation(0, trip.soc_init, trip.t_cl_init_degc, False, demand_w, speed_mps)
    return GeneratedController(library, InputBuilder(preview, truth), start)
