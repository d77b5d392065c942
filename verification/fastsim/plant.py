"""A car of FASTSim on one trip, with the interface of our own plant."""

from statistics import fmean
from typing import Any

import numpy as np

from qpmpc.trip import Trip
from qpmpc.vehicle import Command, PlantState, StepFlows, Vehicle
from qpmpc.vehicle.plant import LONG_AGO_S, POWER_TOLERANCE_W
from qpmpc.verification.fastsim.one_second import (
    ZERO_DEGC_K,
    Model,
    SecondBySecond,
    Tree,
    component,
)


def conditions(model: Model, vehicle: Vehicle) -> tuple[float | None, float | None]:
    """Temperatures of engine at departure and air; None each for a car without heat."""
    if not model.heated:
        return None, None
    return vehicle.trip.t_cl_init_degc, vehicle.thermal.t_amb_degc


class FastsimPlant:
    """A car of FASTSim, driven second by second along a trip.

    Parameters
    ----------
    model : which car
    trip : its cycle is driven
    soc_init : at departure
    obeys : whether commands are carried out, or FASTSim's own control drives
    """

    def __init__(self, model: Model, trip: Trip, soc_init: float, obeys: bool) -> None:
        self._cycle, self._vehicle = trip.cycle, trip.vehicle
        self._soc_init, self._obeys, self._model = soc_init, obeys, model
        self._car = SecondBySecond(
            model, soc_init, float(trip.cycle.speed_mps[0]), *conditions(model, trip.vehicle)
        )
        self._seconds = 0
        self._eta_regen = trip.vehicle.chassis.eta_regen
        # of each second
        self._off_w: list[float] = []
        self._switched: list[bool] = []
        self._missing_w: list[float] = []
        self._beside_mps: list[float] = []
        self._demand_off_w: list[float] = []
        self._cabin_degc: list[float] = []

    def initial_state(self) -> PlantState:
        """Return the state at departure, engine off."""
        return PlantState(self._soc_init, self._vehicle.trip.t_cl_init_degc)

    def step(
        self, state: PlantState, command: Command, demand_w: float, speed_mps: float
    ) -> tuple[PlantState, StepFlows]:
        """Drive the next second of the trip in FASTSim.

        FASTSim computes the road load and knows the speed: `demand_w` is compared with its own.
        Flows of heat are FASTSim's: what leaves by an open thermostat is part of `air_w`, and fuel
        warms the coolant in the second after. They are 0 for a car without heat.

        Parameters
        ----------
        state : as returned of the second before
        command : to the engine
        demand_w, speed_mps : as controllers see them
        """
        k = self._seconds
        wanted_mps = float(self._cycle.speed_mps[k + 1])
        grade = float(self._cycle.step_grade[k])
        car = self._car.drive(wanted_mps, grade, command if self._obeys else None)
        self._seconds += 1
        engine, battery = component(car, "fc")["state"], component(car, "res")["state"]
        on, p_eng_w = bool(engine["fc_on"]), float(engine["pwr_prop_watts"])
        off_w = abs(p_eng_w - command.p_eng_w) if self._obeys else 0.0
        missing_w = self._note(car, command, off_w, demand_w, wanted_mps)
        fuel_g = float(engine["pwr_fuel_watts"]) / self._vehicle.engine.lhv_j_per_g
        heat = self._heat(car)
        following = PlantState(
            float(battery["soc"]),
            heat.get("t_cl_degc", state.t_cl_degc),
            on,
            min(state.engine_for_s + 1, LONG_AGO_S) if on == state.engine_on else 1,
            p_eng_w,
            fuel_g,
        )
        flows = StepFlows(
            fuel_g=fuel_g,
            fuel_w=engine["pwr_fuel_watts"],
            p_eng_w=p_eng_w,
            p_bat_w=battery["pwr_out_electrical_watts"],
            cranking_w=0.0,
            internal_w=battery["pwr_out_chemical_watts"],
            p_friction_w=car["state"]["pwr_brake_watts"] * self._eta_regen,
            p_missing_w=missing_w,
            exhaust_w=heat.get("exhaust_w", 0.0),
            air_w=heat.get("air_w", 0.0),
            radiator_w=0.0,
            cabin_w=heat.get("cabin_w", 0.0),
            boiling_w=0.0,
            coolant_w=heat.get("coolant_w", 0.0),
            started=on and not state.engine_on,
            power_excess_w=off_w if off_w > POWER_TOLERANCE_W else 0.0,
        )
        return following, flows

    def _heat(self, car: Tree) -> dict[str, float]:
        """Return temperature of the engine and flows of heat, of a heated car; keep the cabin's."""
        if not self._model.heated:
            return {}
        engine = component(car, "fc_heat")["state"]
        cabin_k = component(car, "cabin")["state"]["temperature_kelvin"]
        self._cabin_degc.append(float(cabin_k - ZERO_DEGC_K))
        into_w, air_w, cabin_w = (
            float(engine[f"pwr_{name}_watts"])
            for name in ("thrml_to_tm", "thrml_to_amb", "thrml_fc_to_cab")
        )
        return {
            "t_cl_degc": float(engine["temperature_kelvin"] - ZERO_DEGC_K),
            "exhaust_w": float(engine["pwr_fuel_as_heat_watts"]) - into_w,
            "air_w": air_w,
            "cabin_w": cabin_w,
            "coolant_w": into_w - air_w - cabin_w,
        }

    def _note(
        self, car: Tree, command: Command, off_w: float, demand_w: float, wanted_mps: float
    ) -> float:
        """Keep what the second shows of obedience; returns the power that the wheels lacked."""
        state, engine = car["state"], component(car, "fc")["state"]
        lacked_w = float(state["pwr_tractive_for_cyc_watts"] - state["pwr_tractive_watts"])
        missing_w = max(lacked_w, 0.0)
        # faster, too: where it cannot follow, FASTSim solves for a speed that its power suits
        beside_mps = abs(wanted_mps - state["speed_ach_meters_per_second"])
        self._off_w.append(off_w)
        self._switched.append(self._obeys and bool(engine["fc_on"]) != bool(command.engine_on))
        self._missing_w.append(missing_w)
        self._beside_mps.append(beside_mps)
        if not any(self._beside_mps[-2:]):  # else FASTSim drives at other speeds
            friction_w = state["pwr_brake_watts"] * self._eta_regen
            own_w = component(car, "transmission")["state"]["pwr_in_watts"] - friction_w
            self._demand_off_w.append(abs(demand_w - own_w))
        return missing_w

    def account(self) -> dict[str, Any]:
        """Return what FASTSim did not obey; see docs/fastsim.md for the keys."""
        disobeyed = [
            off > POWER_TOLERANCE_W or other
            for off, other in zip(self._off_w, self._switched, strict=True)
        ]
        return {
            "name": self._model.plant,
            "obeys": self._obeys,
            "seconds_not_obeyed": sum(disobeyed),
            "seconds_switched_otherwise": sum(self._switched),
            "power_off_max_w": max(self._off_w, default=0.0),
            "energy_off_j": sum(self._off_w),
            "seconds_off_trace": int(np.count_nonzero(np.array(self._beside_mps) > 0.0)),
            "speed_off_max_mps": max(self._beside_mps, default=0.0),
            "energy_missing_j": sum(self._missing_w),
            "demand_off_max_w": max(self._demand_off_w, default=0.0),
            "cabin_min_degc": min(self._cabin_degc, default=None),
            "cabin_mean_degc": fmean(self._cabin_degc) if self._cabin_degc else None,
        }

    def remarks(self) -> tuple[str, ...]:
        """Say what was not obeyed, if anything."""
        found = self.account()
        if not found["seconds_not_obeyed"]:
            return ()
        return (
            f"FASTSim did not obey in {found['seconds_not_obeyed']} of {self._seconds} s: "
            f"engine power off by {found['power_off_max_w']:.3g} W at most, "
            f"{found['energy_off_j'] / 1e3:.3g} kJ in all, on or off otherwise in "
            f"{found['seconds_switched_otherwise']} s",
        )

    def reservations(self) -> tuple[str, ...]:
        """Say where the car could not follow: its fuel is then that of another road."""
        found = self.account()
        if not found["seconds_off_trace"]:
            return ()
        return (
            f"FASTSim's car could not follow the cycle in {found['seconds_off_trace']} of "
            f"{self._seconds} s, by {found['speed_off_max_mps']:.3g} m/s at most: its wheels "
            f"lacked {found['energy_missing_j'] / 1e3:.3g} kJ",
        )
