"""The two parts that simulation tools run: variables, and C sources before they get a prefix."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qpmpc.codegen.examples import is_example
from qpmpc.codegen.generate import Precision, literals, project_files, template_text, texts_of
from qpmpc.codegen.method import Generated, Method
from qpmpc.codegen.parts.variables import Variable, controller_variables, plant_variables
from qpmpc.codegen.rows.c_text import Writer
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.errors import InputError
from qpmpc.preview.forecast import Trace
from qpmpc.shown import shown
from qpmpc.trip import Trip
from qpmpc.vehicle import heat
from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.vehicle.capability import Capability
from qpmpc.vehicle.engine import optimal_line
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.vehicle.plant import BOILING_DEGC, POWER_TOLERANCE_W

OF_CONTROLLER = ("mpc_part_controller.h", "mpc_part_controller.c")
OF_PLANT = ("mpc_part_plant.h", "mpc_part_plant.c", "mpc_plant.h", "mpc_plant.c")
OF_INSTANCE = ("mpc_instance.h", "mpc_instance.c")  # of either
CALIBRATED = "mpc_part_calibration.h"
PART = "mpc_part.h"  # what mpc_instance.h calls the header of the part


@dataclass(frozen=True)
class Part:
    """One part.

    Attributes
    ----------
    what : it is, in words that may stand in a comment of C
    of_trip : goes on with the name of its trip, a user's text; empty if it knows none
    variables : by value reference
    sources : all C files by name but those of the tool that simulates
    notice : licence
    trip_s : seconds of the trip that it knows; None if it knows none
    precision : of its arithmetic
    """

    what: str
    of_trip: str
    variables: list[Variable]
    sources: dict[str, str]
    notice: str
    trip_s: int | None
    precision: Precision = "f64"

    @property
    def description(self) -> str:
        """What it is and which trip it knows, in one line."""
        return f"{self.what}{self.of_trip}"


def controller_part(
    trip: Trip,
    controller: Generated = "mh-qp",
    settings: ControllerSettings | None = None,
    precision: Precision = "f64",
) -> Part:
    """Return a generated controller that knows its trip.

    Parameters
    ----------
    trip : its forecast is the preview
    controller, settings, precision : to be generated

    Raises
    ------
    InputError
        If the settings do not fit generated code, or the car cannot do the trip.
    """
    _check_road(trip)
    method = Method.of(controller, settings or ControllerSettings())
    values = method.values(trip.vehicle, method.horizon.block_count(trip.forecast.steps))
    files = project_files(values, "host", precision)
    sources = {n: t for n, t in files.items() if n.endswith((".c", ".h")) and not is_example(n)}
    sources |= _programs(OF_CONTROLLER)
    sources["mpc_trip.h"] = _road(trip.forecast, "mpc_real", precision)
    certificate = values.costate is not None
    calibration = values.calibration
    variables = controller_variables(trip.vehicle, calibration, values.learning, certificate)
    sources[CALIBRATED] = template_text(f"{CALIBRATED}.j2", names=calibration.names)
    return Part(
        f"Controller {controller} of {values.vehicle}, {precision}",
        f", which knows the trip {shown(trip.cycle.name)}",
        variables,
        sources | _of_variables(variables, trip.steps, method.prepared),
        files["NOTICE"],
        trip.steps,
        precision,
    )


def plant_part(vehicle: Vehicle, trip: Trip | None = None) -> Part:
    """Return the plant of a vehicle; with a trip it drives that, whose vehicle must be the same."""
    sources = _programs(OF_PLANT)
    sources["mpc_plant_data.h"] = _numbers(vehicle)
    sources["mpc_trip.h"] = (
        "/* There is no trip: demand and speed are inputs. */\n"
        if trip is None
        else _road(trip.truth, "double", "f64")
    )
    driving = "" if trip is None else f", which drives the trip {shown(trip.cycle.name)}"
    variables = plant_variables(vehicle, trip is not None)
    trip_s = None if trip is None else trip.steps
    return Part(
        f"Plant of {vehicle.name}",
        driving,
        variables,
        sources | _of_variables(variables, trip_s),
        template_text("NOTICE_plant.j2"),
        trip_s,
    )


def _check_road(trip: Trip) -> None:
    """Refuse a preview that the generated code would refuse as a whole.

    Raises
    ------
    InputError
        If a second of it is beyond what the car can do.
    """
    can = Capability.of(trip.vehicle, optimal_line(trip.vehicle.engine))
    for what, values, low, high in (
        ("demand in W", trip.forecast.demand_w, can.demand_min_w, can.demand_max_w),
        ("speed in m/s", trip.forecast.speed_mps, 0.0, can.speed_max_mps),
    ):
        bad = np.flatnonzero(~((values >= low) & (values <= high)))
        if bad.size:
            raise InputError(
                f"{shown(trip.cycle.name)}: {what} is {values[bad[0]]:.6g} at {bad[0]} s, beyond "
                f"what {trip.vehicle.name} can do, {low:.6g} to {high:.6g}: no preview for a "
                "controller"
            )


def _programs(names: tuple[str, ...]) -> dict[str, str]:
    texts = texts_of("parts/programs")
    header, *others = names
    return {PART: texts[header]} | {name: texts[name] for name in (*others, *OF_INSTANCE)}


def _of_variables(
    variables: list[Variable], trip_s: int | None, prepared: bool | None = None
) -> dict[str, str]:
    """Return the files of the variables; `prepared`: whether a controller plans before the trip."""
    context = {"trip_s": trip_s or 0, "prepared": prepared, "variables": variables}
    names = ("mpc_variables.h", "mpc_variables.c")
    return {name: template_text(f"{name}.j2", **context) for name in names}


def _road(trace: Trace, kind: str, precision: Precision) -> str:
    arrays = {
        "demand_w": literals(trace.demand_w, precision),
        "speed_mps": literals(trace.speed_mps, precision),
    }
    return template_text("mpc_trip.h.j2", type=kind, arrays=arrays)


def _numbers(vehicle: Vehicle) -> str:
    """Return mpc_plant_data.h."""
    engine, battery, cold = vehicle.engine, vehicle.battery, vehicle.cold_engine
    line, thermal = optimal_line(engine), vehicle.thermal
    scalars: dict[str, float] = {
        "engine_min_w": engine.power_min_w,
        "engine_max_w": engine.power_max_w,
        "ramp_w_per_s": engine.ramp_w_per_s,
        "start_fuel_g": engine.start_fuel_g,
        "start_energy_j": engine.start_energy_j,
        "lhv_j_per_kg": engine.lhv_j_per_kg,
        "cold_k": cold.k,
        "cold_hot_degc": cold.hot_degc,
        "cold_span_k": cold.span_k,
        "cold_exponent": cold.exponent,
        "charge_c": BatteryMaps(battery).charge_c,
        "soc_max": battery.soc_max,
        "battery_discharge_max_w": vehicle.battery_discharge_max_w,
        "battery_charge_max_w": vehicle.battery_charge_max_w,
        "aux_power_w": battery.aux_power_w,
        **{name: float(value) for name, value in thermal.model_dump().items()},
    }
    arrays: dict[str, NDArray[np.float64]] = {
        "soc_grid": np.array(battery.soc_grid),
        "open_circuit_v": np.array(battery.open_circuit_v),
        "resistance_discharge_ohm": np.array(battery.resistance_discharge_ohm),
        "resistance_charge_ohm": np.array(battery.resistance_charge_ohm),
        "line_power_w": line.power_w,
        "fuel_g_per_s": line.fuel_g_per_s,
    }
    functions = {"min": "real_min", "max": "real_max"}
    functions |= {function.__name__: f"heat_{function.__name__}" for function in heat.FUNCTIONS}
    writer = Writer({name: f"plant_{name}" for name in thermal.model_dump()}, functions)
    used = (heat.ua_w_per_k, heat.air_w, heat.radiator_w, heat.cabin_w)
    return template_text(
        "mpc_plant_data.h.j2",
        vehicle=vehicle.name,
        soc_points=len(battery.soc_grid),
        fuel_points=len(line.power_w),
        boiling_degc=BOILING_DEGC,
        tolerance_w=POWER_TOLERANCE_W,
        scalars={name: repr(float(value)) for name, value in scalars.items()},
        arrays={name: literals(array, "f64") for name, array in arrays.items()},
        heat=[writer.function(function) for function in used],
    )
