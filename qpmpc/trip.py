"""One trip: a cycle, the vehicle that drives it, and its forecast."""

import os
from collections.abc import Mapping
from math import inf, nan
from typing import NamedTuple

import numpy as np

from qpmpc.cycles import Cycle, load_cycle
from qpmpc.errors import InputError
from qpmpc.preview import place
from qpmpc.preview.checked import CheckedPreview
from qpmpc.preview.forecast import Trace
from qpmpc.preview.horizon import HorizonSettings
from qpmpc.preview.stages import StageBuilder
from qpmpc.vehicle import DEFAULT_VEHICLE, Plant, PlantState, Vehicle, load_vehicle
from qpmpc.vehicle.battery import derating_remark
from qpmpc.vehicle.belief import differences, with_settings
from qpmpc.vehicle.must_run import too_fast
from qpmpc.vehicle.plant import LONG_AGO_S


class Observation(NamedTuple):
    """Measurements at the start of a step; demand and speed are those of the coming second.

    The last two but one are not measured: a controller counts for itself (`InputMonitor`).

    Attributes
    ----------
    step : number of the step, 0 at departure; steps take 1 s
    soc : state of charge, 0..1
    t_cl_degc : coolant temperature
    engine_on : whether the engine ran in the last step
    demand_w : power demand at the electrical side, negative when braking
    speed_mps : mean speed
    engine_for_s : seconds since the engine was started or stopped, as far as known
    p_eng_before_w : its power in the last step while on; infinite if not known
    fuel_g : injected in the last step; nan if it is not measured
    """

    step: int
    soc: float
    t_cl_degc: float
    engine_on: bool
    demand_w: float
    speed_mps: float
    engine_for_s: int = LONG_AGO_S
    p_eng_before_w: float = inf
    fuel_g: float = nan


class Trip:
    """A cycle driven by a vehicle, with a forecast of it; never changed by a run.

    Parameters
    ----------
    cycle : a name or CSV file as `load_cycle` takes it, or a cycle
    vehicle : a name or TOML file as `load_vehicle` takes it, or a vehicle
    forecast : demand and speed for the long horizon, or a cycle from which they are computed; the
        truth if None. Its length may differ from the trip's.
    model : the vehicle that controllers believe to drive; the truth if None. A controller that you
        make yourself for such a trip is made of its `as_believed`

    Attributes
    ----------
    plant : of the vehicle
    truth : demand, W, and mean speed, m/s, of each second
    forecast : the same as expected in advance
    steps : number of 1 s steps

    Raises
    ------
    InputError
        If a name is unknown, a file cannot be used, or the forecast is neither of the two.
    """

    def __init__(
        self,
        cycle: str | os.PathLike[str] | Cycle,
        vehicle: str | os.PathLike[str] | Vehicle = DEFAULT_VEHICLE,
        forecast: Trace | Cycle | None = None,
        model: Vehicle | None = None,
    ) -> None:
        self.cycle = cycle if isinstance(cycle, Cycle) else load_cycle(cycle)
        self.vehicle = vehicle if isinstance(vehicle, Vehicle) else load_vehicle(vehicle)
        self.plant = Plant(self.vehicle)
        self.model = None if model == self.vehicle else model
        self.truth = Trace.of(self.cycle, self.vehicle)
        if not isinstance(forecast, Trace | Cycle | None):
            raise InputError(
                f"the forecast must be a Cycle, or a Trace of demand and speed, not {forecast!r}"
            )
        self._given = forecast
        if isinstance(forecast, Cycle):
            forecast = Trace.of(forecast, self.vehicle)
        self.forecast = self.truth if forecast is None else forecast
        self._demand_w: list[float] = self.truth.demand_w.tolist()
        self._speed_mps: list[float] = self.truth.speed_mps.tolist()

    @property
    def steps(self) -> int:
        """Number of 1 s steps."""
        return len(self._demand_w)

    def observation(self, step: int, state: PlantState) -> Observation:
        """Return a controller's observation at the start of a step.

        Parameters
        ----------
        step : 0 .. steps - 1
        state : of the plant, measured without error
        """
        return Observation(
            step,
            state.soc,
            state.t_cl_degc,
            state.engine_on,
            self._demand_w[step],
            self._speed_mps[step],
            fuel_g=state.fuel_g,
        )

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a user should know of the trip and of what is believed of it, one line each."""
        of_model = ""
        if self.model is not None:
            different = "; ".join(differences(self.vehicle, self.model))
            of_model = f"the model that all controllers but dp have is wrong: {different}"
        of_forecast = place.remark(self.truth, self.forecast)
        of_battery, of_speed = derating_remark(self.vehicle), self._of_speed()
        return (*self.cycle.remarks, *filter(None, (of_battery, of_speed, of_forecast, of_model)))

    def _of_speed(self) -> str:
        """Say where the engine has to run because of the speed; empty where it nowhere does."""
        fast_s = int(np.count_nonzero(too_fast(self.vehicle, self.truth.speed_mps)))
        if not fast_s:
            return ""
        return (
            f"in {fast_s} of {self.steps} s the car is faster than engine.electric_max_mps, "
            f"{self.vehicle.engine.electric_max_mps:g} m/s: the engine must run"
        )

    @property
    def start(self) -> Observation:
        """Observation at departure."""
        return self.observation(0, self.plant.initial_state())

    def preview(self, horizon: HorizonSettings) -> CheckedPreview:
        """Return the trip ahead, cut into stages at any second and checked."""
        source = StageBuilder(self.vehicle, self.truth, self.forecast, horizon)
        return CheckedPreview(source, self.plant)

    def with_forecast(self, forecast: Trace | Cycle | None) -> "Trip":
        """Return the same trip with another forecast; the truth if None."""
        return Trip(self.cycle, self.vehicle, forecast, self.model)

    def with_vehicle(self, vehicle: Vehicle) -> "Trip":
        """Return the same trip by another vehicle, with the same forecast and model.

        The demand of a forecast given as a cycle is computed anew; one given as a trace stays.
        """
        return Trip(self.cycle, vehicle, self._given, self.model)

    @property
    def as_believed(self) -> "Trip":
        """The trip as controllers know it: driven by the model."""
        return self if self.model is None else Trip(self.cycle, self.model, self._given)

    @property
    def believed(self) -> Vehicle:
        """The vehicle that controllers believe to drive."""
        return self.vehicle if self.model is None else self.model

    def with_settings(self, settings: Mapping[str, object]) -> "Trip":
        """Return the same trip with dotted settings of its vehicle and of the model of it.

        Those of the vehicle apply to a model of its own too; ``model.NAME`` is a factor of `Belief`
        on the vehicle.

        Raises
        ------
        InputError
            If a key does not exist or a value is not allowed.
        """
        vehicle, model = with_settings(self.vehicle, self.model, settings)
        return Trip(self.cycle, vehicle, self._given, model)

    def same_as(self, other: "Trip") -> bool:
        """Whether cycle, vehicle, model and forecast are equal number by number."""
        return self is other or (
            self.same_road_as(other)
            and self.model == other.model
            and _equal(self.forecast, other.forecast)
        )

    def same_road_as(self, other: "Trip") -> bool:
        """Whether cycle and vehicle are equal number by number, whatever is forecast."""
        return self is other or (
            self.cycle.name == other.cycle.name
            and self.vehicle == other.vehicle
            and _equal(self.truth, other.truth)
        )

    def __repr__(self) -> str:
        return f"Trip({self.cycle.name!r}, {self.vehicle.name!r}, {self.steps} s)"


def _equal(a: Trace, b: Trace) -> bool:
    return np.array_equal(a.demand_w, b.demand_w) and np.array_equal(a.speed_mps, b.speed_mps)


def as_trip(
    cycle: str | os.PathLike[str] | Cycle | Trip,
    vehicle: str | os.PathLike[str] | Vehicle | None,
    forecast: Trace | Cycle | None,
) -> Trip:
    """Return a trip made from a user's arguments; a trip itself is returned unchanged.

    Raises
    ------
    InputError
        If a vehicle or a forecast is given beside a trip, which has its own; see `Trip`.
    """
    if not isinstance(cycle, Trip):
        return Trip(cycle, DEFAULT_VEHICLE if vehicle is None else vehicle, forecast)
    if vehicle is not None or forecast is not None:
        raise InputError("a Trip has its vehicle and its forecast: give them to Trip(...)")
    return cycle
