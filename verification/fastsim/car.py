"""Cars of FASTSim as foreign ones: ``--plant fastsim``, ``--plant fastsim-sonata``."""

from collections.abc import Mapping
from importlib.metadata import version

from qpmpc.controllers.base import Controller
from qpmpc.controllers.settings import SettingsLike
from qpmpc.errors import InputError
from qpmpc.trip import Observation, Trip
from qpmpc.vehicle import Command, Vehicle
from qpmpc.verification.fastsim.believed import believed_vehicle
from qpmpc.verification.fastsim.heat import CABIN_DEGC, T_CL_DEGC
from qpmpc.verification.fastsim.one_second import (
    PRIUS,
    SONATA,
    Model,
    component,
    departing,
    driven,
    shipped_car,
    whole_road,
)
from qpmpc.verification.fastsim.plant import FastsimPlant, conditions

ALLOWED = ("engine.", "trip.soc_init", "trip.eta_eq", "battery.soc_min", "battery.soc_max")
# of a heated car besides
ALLOWED_HEAT = (
    "cold_engine.",
    "thermal.t_amb_degc",
    "thermal.t_cl_min_degc",
    "thermal.t_cl_max_degc",
    "trip.t_cl_init_degc",
)
ROUNDS = 5  # of balancing SOC, as many as FASTSim's `run` allows


class OwnControl(Controller):
    """FASTSim's own control, which decides inside the plant: what this commands is not used.

    It departs at the SOC at which it also arrives, found as FASTSim's `run` finds it: each round
    starts where the last one ended, until the battery gave less than `res_per_fuel_lim` of the
    fuel's energy.
    """

    implementation = "rust"
    has_monitor = has_safety_layer = True
    decides_online = False

    def __init__(
        self, trip: Trip, settings: SettingsLike | None = None, model: Model = PRIUS
    ) -> None:
        self.name = model.plant
        super().__init__(trip, settings)
        t_cl_degc, t_amb_degc = conditions(model, trip.vehicle)
        car, road = shipped_car(model), whole_road(trip.cycle, t_amb_degc)
        speed_mps = float(trip.cycle.speed_mps[0])
        limit = component(car, "sim_params")["res_per_fuel_lim"]
        self.soc_init = trip.vehicle.trip.soc_init
        for _ in range(ROUNDS):
            end = driven(departing(car, self.soc_init, speed_mps, t_cl_degc), road)
            battery, engine = component(end, "res")["state"], component(end, "fc")["state"]
            given_j, burnt_j = battery["energy_out_chemical_joules"], engine["energy_fuel_joules"]
            if abs(given_j) < limit * burnt_j:
                self.remarks.append(
                    f"{self.name} on {trip.cycle.name}: departs at SOC {self.soc_init:.4g}, found "
                    f"in rounds until it arrives at it: the battery gives less than {limit:.1%} of "
                    "the fuel's energy"
                )
                return
            self.soc_init = float(battery["soc"])
        self.remarks.append(
            f"{self.name} on {trip.cycle.name}: departs at SOC {self.soc_init:.4g}, found in "
            f"{ROUNDS} rounds, but does not arrive at it"
        )

    def step(self, seen: Observation) -> Command:
        """Return a command that the plant does not read."""
        return Command(False, 0.0)


class Fastsim:
    """A car of FASTSim, driven second by second.

    Parameters
    ----------
    model : which
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self.name = model.plant

    def vehicle(self, engine_of: Vehicle | None, settings: Mapping[str, object]) -> Vehicle:
        """Return what controllers believe; see `ForeignCar` and `believed_vehicle`."""
        allowed = ALLOWED + (ALLOWED_HEAT if self.model.heated else ())
        idle = [key for key in settings if not key.startswith(allowed)]
        if idle:
            raise InputError(
                f"--plant {self.name}: {', '.join(idle)} {'has' if len(idle) == 1 else 'have'} no "
                "effect, road, battery and coolant are FASTSim's: what controllers believe can be "
                f"set by {', '.join(key + '*' if key.endswith('.') else key for key in allowed)}"
            )
        believed = believed_vehicle(engine_of, self.model).with_settings(dict(settings))
        if not self.model.heated:
            return believed
        # what the cabin asks for, and with it the belief, depends on it
        t_amb_degc = believed.thermal.t_amb_degc
        return believed_vehicle(engine_of, self.model, t_amb_degc).with_settings(dict(settings))

    def own_control(self, trip: Trip) -> Controller:
        """Return FASTSim's own control."""
        return OwnControl(trip, model=self.model)

    def plant(self, trip: Trip, controller: Controller) -> FastsimPlant:
        """Return the car for one run."""
        if isinstance(controller, OwnControl):
            return FastsimPlant(self.model, trip, controller.soc_init, obeys=False)
        return FastsimPlant(self.model, trip, trip.vehicle.trip.soc_init, obeys=True)

    def remarks(self, vehicle: Vehicle) -> list[str]:
        """Return what every run on this plant rests on."""
        heat = (
            f"Air of {vehicle.thermal.t_amb_degc:g} °C; cabin and battery depart at "
            f"{CABIN_DEGC:g} °C"
            if self.model.heated
            else f"No coolant: {T_CL_DEGC:g} °C throughout"
        )
        said = [
            f"plant: the {self.model.car} of FASTSim {version('fastsim')}; {vehicle.name} is what "
            f"controllers believe. {heat}. Fuel in g of "
            f"{vehicle.engine.lhv_j_per_kg / 1e6:g} MJ/kg",
            "what final SOC differs from the initial one is priced at an efficiency of "
            f"{vehicle.trip.eta_eq:.3g} (trip.eta_eq)",
        ]
        if self.model.heated and vehicle.thermal.t_amb_degc > CABIN_DEGC:
            said.append(
                f"the air is warmer than the cabin of {CABIN_DEGC:g} °C: FASTSim cools it from the "
                "battery, of which controllers know nothing"
            )
        if vehicle.engine.start_fuel_g or vehicle.engine.start_energy_j:
            said.append("starts cost something in what controllers believe only, not in FASTSim")
        return said


FASTSIM = Fastsim(PRIUS)
FASTSIM_SONATA = Fastsim(SONATA)
