"""The C controller's input, filled in by its own forecast functions, as on a control unit."""

import ctypes
from typing import Any

from qpmpc.codegen.host_library import HostLibrary
from qpmpc.errors import InputError
from qpmpc.preview.forecast import Trace
from qpmpc.preview.place import forecast_seconds
from qpmpc.trip import Observation


class Road:
    """A trace as the C code's `mpc_road`; it keeps the arrays alive.

    Parameters
    ----------
    trace : demand and speed
    real : type of the numbers in C
    """

    def __init__(self, trace: Trace, real: Any) -> None:
        pointer, array = ctypes.POINTER(real), real * trace.steps

        class MpcRoad(ctypes.Structure):
            _fields_ = [("demand_w", pointer), ("speed_mps", pointer), ("steps", ctypes.c_int32)]

        self._arrays = array(*trace.demand_w.tolist()), array(*trace.speed_mps.tolist())
        self._bytes = ctypes.sizeof(real)
        self._pointer, self._type, self.steps = pointer, MpcRoad, trace.steps

    def after(self, step: int) -> Any:
        """Return the road from a second to its end."""
        left = max(self.steps - step, 0)
        start = (self.steps - left) * self._bytes
        at = [ctypes.addressof(array) + start for array in self._arrays]
        demand_w, speed_mps = (ctypes.cast(address, self._pointer) for address in at)
        return self._type(demand_w, speed_mps, left)


class ForecastInputs:
    """Fills the controller's input in C; the same numbers as `InputBuilder`'s.

    Parameters
    ----------
    library : of the controller
    truth : trace for the short horizon
    forecast : trace for the long horizon; `truth` if None

    Raises
    ------
    InputError
        If the C code refuses the forecast.
    """

    def __init__(self, library: HostLibrary, truth: Trace, forecast: Trace | None = None) -> None:
        functions = library.functions
        self._same = forecast is None
        self._seen = Road(truth, library.real)
        self._trip = Road(forecast or truth, library.real)
        self._forecast_second = forecast_seconds(truth, forecast or truth).tolist()
        self._memory = ctypes.create_string_buffer(functions.mpc_forecast_bytes())
        self._from_forecast = functions.mpc_in_from_forecast
        self._from_preview = functions.mpc_in_from_preview
        if functions.mpc_forecast_start(self._memory, ctypes.byref(self._trip.after(0))):
            raise InputError("the generated controller refuses the forecast: see mpc_forecast.h")

    def fill(self, seen: Observation, into: Any) -> None:
        """Write all inputs of one step."""
        into.soc, into.t_cl_degc = seen.soc, seen.t_cl_degc
        into.demand_w, into.speed_mps = seen.demand_w, seen.speed_mps
        into.engine_on = int(seen.engine_on)
        if self._same:
            self._from_forecast(self._memory, seen.step, ctypes.byref(into))
        else:
            ahead = ctypes.byref(self._seen.after(seen.step))
            end = min(seen.step + len(into.short_demand_w), self._seen.steps)
            beyond = self._forecast_second[end]
            self._from_preview(self._memory, seen.step, beyond, ahead, ctypes.byref(into))
