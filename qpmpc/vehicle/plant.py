"""The plant: one explicit step of SOC and coolant temperature, paper eqs. (1)-(5).

Every controller is measured on this plant. Controllers never call it.
"""

from typing import NamedTuple

from qpmpc.vehicle import heat
from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.vehicle.engine import alpha_at, optimal_line
from qpmpc.vehicle.parameters import Vehicle

POWER_TOLERANCE_W = 1e-6
BOILING_DEGC = 130.0  # half water, half glycol, at the overpressure of a usual cap, 1.1 bar
EMPTY, FULL = 0.0, 1.0  # SOC
LONG_AGO_S = 1_000_000  # as good as any time before; counts of seconds end here


class PlantState(NamedTuple):
    """State at the start of a step.

    Attributes
    ----------
    soc, t_cl_degc : of battery and coolant
    engine_on : whether the engine ran in the last step
    engine_for_s : whole seconds since it was started or stopped
    p_eng_w : its power in the last step, 0 with the engine off
    fuel_g : injected in the last step
    """

    soc: float
    t_cl_degc: float
    engine_on: bool = False
    engine_for_s: int = LONG_AGO_S
    p_eng_w: float = 0.0
    fuel_g: float = 0.0


class Command(NamedTuple):
    """A controller's command to the engine for one step.

    Attributes
    ----------
    engine_on : whether the engine runs
    p_eng_w : its power, 0 with the engine off
    """

    engine_on: bool
    p_eng_w: float


class StepFlows(NamedTuple):
    """Every flow of one step, in W unless the name has another unit; the flows must balance.

    `p_bat_w` is the battery's power at its terminals (discharge positive), `cranking_w` what of it
    cranks the engine, `internal_w` the power that leaves its store, `p_friction_w` that of the
    friction brakes (electrical side, positive),
    `p_missing_w` demand that neither engine nor battery can meet, `boiling_w` heat that leaves with
    the steam of boiling coolant. `power_excess_w` is the excess of the command over engine or
    battery power limits.
    """

    fuel_g: float
    fuel_w: float
    p_eng_w: float
    p_bat_w: float
    cranking_w: float
    internal_w: float
    p_friction_w: float
    p_missing_w: float
    exhaust_w: float
    air_w: float
    radiator_w: float
    cabin_w: float
    boiling_w: float
    coolant_w: float
    started: bool
    power_excess_w: float


class Plant:
    """Nonlinear plant of one vehicle, advanced by `step`.

    Parameters
    ----------
    vehicle : parameters
    step_s : explicit step, s
    """

    def __init__(self, vehicle: Vehicle, step_s: float = 1.0) -> None:
        self.vehicle = vehicle
        self.step_s = step_s
        self.line = optimal_line(vehicle.engine)
        self.battery = BatteryMaps(vehicle.battery)

    def initial_state(self) -> PlantState:
        """Return the state at the start of a trip: engine off, SOC and coolant from `trip`."""
        return PlantState(self.vehicle.trip.soc_init, self.vehicle.trip.t_cl_init_degc)

    def charge_limit_w(self, soc: float) -> float:
        """Most power the battery accepts: its limit, or what just fills it to soc_max; >= 0."""
        filling = -self.battery.power_to_reach_w(soc, self.vehicle.battery.soc_max, self.step_s)
        return min(self.vehicle.battery_charge_max_w, max(filling, 0.0))

    def step(
        self, state: PlantState, command: Command, demand_w: float, speed_mps: float
    ) -> tuple[PlantState, StepFlows]:
        """Advance one step.

        dSOC/dt = -I / C_bat (eq. 1), P_bat = P_d + P_aux + P_crank - P_eng (eq. 2),
        M C dT/dt = Q_fuel - P_eng - Q_exh - Q_air - Q_rad - Q_heat (eq. 3),
        Q_fuel = LHV alpha(T) f_fuel(P_eng) (eqs. 4, 5), Q_exh = x (Q_fuel - P_eng).

        Braking power that the battery cannot take goes to the friction brakes; the battery takes
        less than its power limit where more would fill it beyond soc_max within the step. A
        command beyond the engine's limits, its ramp among them, is clipped to them; power that
        clipping and the battery leave uncovered is reported as `power_excess_w`. A start cranks the
        engine with the battery. Shortest runs and rests are not enforced: a controller may have
        to break them to keep a limit. Nor is the engine started where the car is too fast for one
        that is off: as with demand beyond the battery the command is obeyed, and the excess counted
        (`qpmpc.limits`). While on it burns at least what idling takes, in overrun too. Whatever is
        asked, the states stay
        physical: the battery gives no more than it holds, the cabin takes no heat from coolant at
        ambient temperature, and coolant beyond `BOILING_DEGC` boils.

        Parameters
        ----------
        state : at the start of the step
        command : engine on or off and its power; power with the engine off counts as excess
        demand_w : P_d, negative when braking
        speed_mps : mean speed of the step
        """
        vehicle = self.vehicle
        engine, battery, h = vehicle.engine, vehicle.battery, self.step_s
        on = command.engine_on
        started = on and not state.engine_on
        ramped = (state.p_eng_w if state.engine_on else 0.0) + engine.ramp_w_per_s * h
        low, high = (engine.power_min_w, min(engine.power_max_w, ramped)) if on else (0.0, 0.0)
        p_eng = min(max(command.p_eng_w, low), high)
        cranking = engine.start_energy_j / h if started else 0.0
        p_bat = demand_w + battery.aux_power_w + cranking - p_eng
        friction = 0.0
        accepted = self.charge_limit_w(state.soc)
        if p_bat < -accepted:
            friction = min(-accepted - p_bat, max(-demand_w, 0.0))
            p_bat += friction
        excess = max(
            abs(p_eng - command.p_eng_w),
            p_bat - vehicle.battery_discharge_max_w,
            -accepted - p_bat,
        )
        wanted = p_bat
        p_bat = min(p_bat, self.battery.power_to_reach_w(state.soc, EMPTY, h))
        p_bat = max(p_bat, self.battery.power_to_reach_w(state.soc, FULL, h))
        fuel_g = 0.0
        if on:
            fuel_g = h * alpha_at(vehicle.cold_engine, state.t_cl_degc) * self.line.fuel.at(p_eng)
            fuel_g += engine.start_fuel_g * started
        fuel_w = fuel_g / h * engine.lhv_j_per_kg * 1e-3
        exhaust = vehicle.thermal.exhaust_share * (fuel_w - p_eng)
        air = heat.air_w(vehicle.thermal, state.t_cl_degc, speed_mps)
        radiator = heat.radiator_w(vehicle.thermal, state.t_cl_degc)
        cabin = heat.cabin_w(vehicle.thermal, state.t_cl_degc)
        coolant = fuel_w - p_eng - exhaust - air - radiator - cabin
        w_per_k = vehicle.thermal.heat_capacity_j_per_k / h
        room_k = state.t_cl_degc - vehicle.thermal.t_amb_degc  # to ambient temperature
        spared = min(max(-coolant - max(room_k, 0.0) * w_per_k, 0.0), cabin)
        cabin, coolant = cabin - spared, coolant + spared
        boiling = max(coolant - (BOILING_DEGC - state.t_cl_degc) * w_per_k, 0.0)
        coolant -= boiling
        current = self.battery.current_a(state.soc, p_bat)
        following = PlantState(
            min(max(state.soc - h * current / self.battery.charge_c, EMPTY), FULL),
            state.t_cl_degc + coolant / w_per_k,
            on,
            min(state.engine_for_s + 1, LONG_AGO_S) if on == state.engine_on else 1,
            p_eng,
            fuel_g,
        )
        flows = StepFlows(
            fuel_g=fuel_g,
            fuel_w=fuel_w,
            p_eng_w=p_eng,
            p_bat_w=p_bat,
            cranking_w=cranking,
            internal_w=current * self.battery.open_circuit.at(state.soc),
            p_friction_w=friction,
            p_missing_w=wanted - p_bat,
            exhaust_w=exhaust,
            air_w=air,
            radiator_w=radiator,
            cabin_w=cabin,
            boiling_w=boiling,
            coolant_w=coolant,
            started=started,
            power_excess_w=excess if excess > POWER_TOLERANCE_W else 0.0,
        )
        return following, flows
