"""The QP built by differentiation: CasADi expands the bilinear problem into matrices."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpmpc.preview.stages import Stages
from qpmpc.pwa.fit import PwaFit
from qpmpc.pwa.model import PwaModel
from qpmpc.qp.linearisation import Linearisation
from qpmpc.qp.rows import ACCURATE_STAGE_S, REACH_MARGIN_SOC, SIGMA_FORCED, VARS, Var
from qpmpc.qp.stage_qp import T_CL_MAX_MARGIN_K, QpSettings
from qpmpc.vehicle.heat import ua_w_per_k
from qpmpc.vehicle.parameters import Thermal, Vehicle
from qpmpc.verification.nonlinear.maps import casadi
from qpmpc.verification.renderings.matrices import Matrices

Floats = NDArray[np.float64]


class CasadiQp:
    """The multi-horizon QP in SI units, from symbolic cost and constraints.

    The cold engine burns alpha(T) F, a product of two variables. The program holds it as such,
    with the affine piece of alpha that is active at T^; CasADi differentiates it about (T^, F^),
    so neither the expansion nor any matrix entry is written by hand.

    Parameters
    ----------
    vehicle, model : plant parameters and the PWA curves made from them
    stages : number of stages n
    settings : weights and margins
    """

    def __init__(
        self, vehicle: Vehicle, model: PwaModel, stages: int, settings: QpSettings
    ) -> None:
        self.vehicle, self.model, self.settings, self.stages = vehicle, model, settings, stages
        ca = casadi()
        x = ca.SX.sym("x", VARS, stages)
        state = ca.SX.sym("state", 2)
        road = ca.SX.sym("road", 4, stages)  # h, P0, v, l
        about = ca.SX.sym("about", 5, stages)  # T^, F^, E^, T at start and end
        piece = ca.SX.sym("piece", 2, stages)  # slope and intercept of alpha
        smoothing = ca.SX.sym("smoothing", VARS, stages)
        cost, zero, positive = self._program(x, state, road, about, piece)
        cost += 0.5 * ca.sumsqr(smoothing * x)
        flat = ca.vec(x)
        hessian, gradient = ca.hessian(cost, flat)
        origin = ca.DM.zeros(flat.shape)
        outputs = [
            ca.substitute(gradient, flat, origin),
            hessian,
            ca.jacobian(zero, flat),
            ca.substitute(zero, flat, origin),
            ca.jacobian(positive, flat),
            ca.substitute(positive, flat, origin),
        ]
        self._matrices: Any = ca.Function(
            "matrices", [state, road, about, piece, smoothing], outputs
        )

    def matrices(
        self,
        stages: Stages,
        soc: float,
        t_cl_degc: float,
        about: Linearisation,
        smoothing: Floats | None = None,
    ) -> Matrices:
        """Cost and rows for a horizon, a state and a linearisation point.

        Parameters
        ----------
        smoothing : weights w of the small quadratic terms 1/2 (w x)^2, shape (n, VARS); none if
            None
        """
        road = np.stack([stages.duration_s, stages.net_w, stages.speed_mps, stages.internal_off_w])
        alpha, t_cl = self.model.alpha, about.t_cl_degc
        active = np.searchsorted(alpha.breakpoints[1:-1], t_cl, side="right")
        weights = np.zeros((self.stages, VARS)) if smoothing is None else smoothing
        q, p, equal, equal_at, upper, upper_at = self._matrices(
            [soc, t_cl_degc],
            road,
            np.stack(
                [
                    t_cl,
                    about.fuel_g_per_s,
                    about.p_eng_w,
                    about.t_cl_start_degc,
                    about.t_cl_end_degc,
                ]
            ),
            np.stack([alpha.slope[active], alpha.intercept[active]]),
            weights.T,
        )
        hessian = np.array(p.full())
        return Matrices(
            gradient=q.full().ravel(),
            hessian=hessian,
            equal=equal.full(),
            equal_to=-equal_at.full().ravel(),
            upper=-upper.full(),  # positive >= 0
            upper_to=upper_at.full().ravel(),
        )

    def _program(
        self, x: Any, state: Any, road: Any, about: Any, piece: Any
    ) -> tuple[Any, Any, Any]:
        """Cost in g, what must be zero, what must not be negative."""
        ca, vehicle, settings = casadi(), self.vehicle, self.settings
        battery, engine, th = vehicle.battery, vehicle.engine, vehicle.thermal
        lhv_j_per_g = engine.lhv_j_per_g
        cost: Any = 0.0
        zero: list[Any] = []
        positive: list[Any] = []
        soc_before, t_before, reach = state[0], state[1], state[0]
        for k in range(self.stages):
            h, net, speed, off = (road[i, k] for i in range(4))
            soc, t_cl, power, on = (x[var, k] for var in (Var.SOC, Var.T_CL, Var.P_ENG, Var.ON))
            fuel, internal, slack = (x[var, k] for var in (Var.FUEL, Var.INTERNAL, Var.T_SLACK))
            mean = 0.5 * (t_before + t_cl)
            burnt = _expanded(mean, fuel, about[0, k], about[1, k], piece[:, k])
            cost += h * burnt + settings.slack_g_per_k * slack

            zero.append(soc - soc_before + h * internal / self.model.battery_energy_j)
            positive += [fuel - line for line in _lines(self.model.fuel, power, on)]
            # sigma l((sigma P0 - E) / sigma) + (1 - sigma) l(P0) <= G
            positive += [
                internal - line - (1.0 - on) * off
                for line in _lines(self.model.battery, on * net - power, on)
            ]
            most = ca.fmin(engine.power_max_w, net + battery.power_charge_max_w)
            missing = net - battery.power_discharge_max_w
            positive += [
                most * on - power,
                power - engine.power_min_w * on - ca.fmax(missing - engine.power_min_w, 0.0),
                1.0 - on,
                on - ca.if_else(missing > 0.0, SIGMA_FORCED, 0.0),
            ]

            ua = ua_w_per_k(th, speed)
            fade = (about[0, k] - th.cabin_heat_from_degc) / (
                th.cabin_heat_full_degc - th.cabin_heat_from_degc
            )
            cabin = th.cabin_heat_w * ca.fmin(ca.fmax(fade, 0.0), 1.0)

            def heat(burnt: Any, power: Any, mean: Any, ua: Any = ua, cabin: Any = cabin) -> Any:
                gained = (1.0 - th.exhaust_share) * (lhv_j_per_g * burnt - power)
                return gained - ua * (mean - th.t_amb_degc) - cabin

            mean_at = 0.5 * (about[3, k] + about[4, k])
            burnt_at = _expanded(mean_at, about[1, k], about[0, k], about[1, k], piece[:, k])
            heat_at = heat(burnt_at, about[2, k], mean_at)
            after = _thermostat(th, h, (heat(burnt, power, mean), t_before), (heat_at, about[3, k]))
            zero.append(t_cl - after)
            positive += [
                t_cl + slack - th.t_cl_min_degc - settings.t_cl_margin_k,
                th.t_cl_max_degc - T_CL_MAX_MARGIN_K - t_cl + slack,
                slack,
            ]

            strongest = ca.fmax(net - engine.power_max_w, -battery.power_charge_max_w)
            charged = ca.mmax(ca.vertcat(*_lines(self.model.battery, strongest, 1.0)))
            reach -= h * charged / self.model.battery_energy_j
            low, high = self._soc_limits(k, h)
            positive += [high - soc, soc - ca.fmin(low, reach - REACH_MARGIN_SOC)]
            soc_before, t_before = soc, t_cl
        if settings.soc_penalty_g:
            cost += settings.soc_penalty_g * (soc_before - vehicle.trip.soc_init) ** 2
        return cost, ca.vertcat(*zero), ca.vertcat(*positive)

    def _soc_limits(self, k: int, h: Any) -> tuple[Any, float]:
        """Lower and upper limit of SOC at the end of stage k, before reach."""
        battery, trip, settings = self.vehicle.battery, self.vehicle.trip, self.settings
        if k == self.stages - 1 and not settings.soc_penalty_g:
            return (
                max(settings.terminal_low * trip.soc_init, battery.soc_min),
                min(settings.terminal_high * trip.soc_init, battery.soc_max),
            )
        reserve = settings.soc_reserve * max(trip.soc_init - battery.soc_min, 0.0)
        low = battery.soc_min + casadi().if_else(h > ACCURATE_STAGE_S, reserve, 0.0)
        return low, battery.soc_max


def _lines(fit: PwaFit, value: Any, on: Any) -> list[Any]:
    """Pieces of a PWA curve in perspective, slope x value + intercept x on."""
    return [a * value + b * on for a, b in zip(fit.slope, fit.intercept, strict=True)]


def _expanded(t_cl: Any, fuel: Any, t_at: Any, fuel_at: Any, piece: Any) -> Any:
    """alpha(T) F to first order about (T^, F^), by differentiation."""
    ca = casadi()
    both = ca.SX.sym("both", 2)
    product = (piece[0] * both[0] + piece[1]) * both[1]
    here = ca.vertcat(t_at, fuel_at)
    value = ca.substitute(product, both, here)
    slopes = ca.substitute(ca.gradient(product, both), both, here)
    return value + ca.dot(slopes, ca.vertcat(t_cl, fuel) - here)


def _thermostat(th: Thermal, h: Any, now: tuple[Any, Any], at: tuple[Any, Any]) -> Any:
    """Coolant at the end of a stage to first order about (heat, T at start), by differentiation.

    C dT/dt = heat - radiator, the radiator opening linearly over the thermostat's span.
    """
    ca = casadi()
    full_w = th.radiator_w_per_k * (th.t_cl_max_degc - th.t_amb_degc)
    slope, capacity = full_w / th.thermostat_span_k, th.heat_capacity_j_per_k
    both = ca.SX.sym("both", 2)
    heat, u = both[0], both[1] - th.thermostat_open_degc

    def shut(u: Any, span: Any) -> Any:
        return u + heat * span / capacity

    def open_(u: Any, span: Any) -> Any:
        return heat / slope + (u - heat / slope) * ca.exp(-span * slope / capacity)

    opens_at = -u * capacity / ca.if_else(heat > 0.0, heat, 1.0)
    falling = ca.if_else(heat < 0.0, heat, -1.0) / slope
    closes_at = capacity / slope * ca.log((ca.fmax(u, 0.0) - falling) / -falling)
    from_shut = ca.if_else(shut(u, h) > 0.0, open_(0.0, h - opens_at), shut(u, h))
    from_open = ca.if_else(open_(u, h) < 0.0, shut(0.0, h - closes_at), open_(u, h))
    end = ca.if_else(u < 0.0, from_shut, from_open) + th.thermostat_open_degc
    here, there = ca.vertcat(*now), ca.vertcat(*at)
    value = ca.substitute(end, both, there)
    slopes = ca.substitute(ca.gradient(end, both), both, there)
    return value + ca.dot(slopes, here - there)
