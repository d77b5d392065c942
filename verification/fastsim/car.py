"""FASTSim's Prius as a foreign car: ``--plant fastsim``."""

from collections.abc import Mapping
from importlib.metadata import version

from qpmpc.controllers.base import Controller
from qpmpc.controllers.settings import SettingsLike
from qpmpc.errors import InputError
from qpmpc.trip import Observation, Trip
from qpmpc.vehicle import Command, Vehicle
from qpmpc.verification.fastsim.believed import T_CL_DEGC, believed_vehicle
from qpmpc.verification.fastsim.one_second import (
    component,
    departing,
    driven,
    shipped_car,
    whole_road,
)
from qpmpc.verification.fastsim.plant import FastsimPlant

ALLOWED = ("engine.", "trip.soc_init", "trip.eta_eq", "battery.soc_min", "battery.soc_max")
ROUNDS = 5  # of balancing SOC, as many as FASTSim's `run` allows


class OwnControl(Controller):
    """FASTSim's own control, which decides inside the plant: what this commands is not used.

    It departs at the SOC at which it also arrives, found as FASTSim's `run` finds it: each round
    starts where the last one ended, until the battery gave less than `res_per_fuel_lim` of the
    fuel's energy.
    """

    name = "fastsim"
    implementation = "rust"
    has_monitor = has_safety_layer = True
    decides_online = False

    def __init__(self, trip: Trip, settings: SettingsLike | None = None) -> None:
        super().__init__(trip, settings)
        car, road = shipped_car(), whole_road(trip.cycle)
        limit = component(car, "sim_params")["res_per_fuel_lim"]
        self.soc_init = trip.vehicle.trip.soc_init
        for _ in range(ROUNDS):
            end = driven(departing(car, self.soc_init, float(trip.cycle.speed_mps[0])), road)
            battery, engine = component(end, "res")["state"], component(end, "fc")["state"]
            given_j, burnt_j = battery["energy_out_chemical_joules"], engine["energy_fuel_joules"]
            if abs(given_j) < limit * burnt_j:
                self.remarks.append(
                    f"fastsim on {trip.cycle.name}: departs at SOC {self.soc_init:.4g}, found in "
                    f"rounds until it arrives at it: the battery gives less than {limit:.1%} of "
                    "the fuel's energy"
                )
                return
            self.soc_init = float(battery["soc"])
        self.remarks.append(
            f"fastsim on {trip.cycle.name}: departs at SOC {self.soc_init:.4g}, found in {ROUNDS} "
            "rounds, but does not arrive at it"
        )

    def step(self, seen: Observation) -> Command:
        """Return a command that the plant does not read."""
        return Command(False, 0.0)


class Fastsim:
    """FASTSim's 2016 Prius Two, driven second by second."""

    name = OwnControl.name

    def vehicle(self, engine_of: Vehicle | None, settings: Mapping[str, object]) -> Vehicle:
        """Return what controllers believe; see `ForeignCar` and `believed_vehicle`."""
        idle = [key for key in settings if not key.startswith(ALLOWED)]
        if idle:
            raise InputError(
                f"--plant fastsim: {', '.join(idle)} {'has' if len(idle) == 1 else 'have'} no "
                "effect, road, battery and coolant are FASTSim's: what controllers believe can be "
                f"set by {', '.join(key + '*' if key.endswith('.') else key for key in ALLOWED)}"
            )
        return believed_vehicle(engine_of).with_settings(dict(settings))

    def own_control(self, trip: Trip) -> Controller:
        """Return FASTSim's own control."""
        return OwnControl(trip)

    def plant(self, trip: Trip, controller: Controller) -> FastsimPlant:
        """Return FASTSim's Prius for one run."""
        if isinstance(controller, OwnControl):
            return FastsimPlant(trip, controller.soc_init, obeys=False)
        return FastsimPlant(trip, trip.vehicle.trip.soc_init, obeys=True)

    def remarks(self, vehicle: Vehicle) -> list[str]:
        """Return what every run on this plant rests on."""
        said = [
            f"plant: the 2016 Prius Two of FASTSim {version('fastsim')}; {vehicle.name} is what "
            f"controllers believe. No coolant: {T_CL_DEGC:g} °C throughout. Fuel in g of "
            f"{vehicle.engine.lhv_j_per_kg / 1e6:g} MJ/kg",
            "what final SOC differs from the initial one is priced at an efficiency of "
            f"{vehicle.trip.eta_eq:.3g} (trip.eta_eq)",
        ]
        if vehicle.engine.start_fuel_g or vehicle.engine.start_energy_j:
            said.append("starts cost something in what controllers believe only, not in FASTSim")
        return said


FASTSIM = Fastsim()
