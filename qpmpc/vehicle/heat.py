"""Heat into and out of the coolant, paper eq. (3): one text for plant, QP, generated C and DP.

Each function is one expression in the subset of `qpmpc.qp.expressions`, so that it can be rendered
in other arithmetic (`in_arithmetic`) and in C (`qpmpc.codegen.rows.c_text`). `th` can be any object
with the fields of `Thermal`.
"""

from collections.abc import Callable
from types import FunctionType
from typing import Any

from qpmpc.vehicle.parameters import Thermal


def ua_w_per_k(th: Thermal, speed_mps: float) -> float:
    """Conductance to the air, UA0 + UA1 v."""
    return th.ua0_w_per_k + th.ua1_w_per_k_per_mps * speed_mps


def air_w(th: Thermal, t_cl_degc: float, speed_mps: float) -> float:
    """Heat lost to the air, Q_air = (UA0 + UA1 v) (T_cl - T_amb)."""
    return ua_w_per_k(th, speed_mps) * (t_cl_degc - th.t_amb_degc)


def radiator_w(th: Thermal, t_cl_degc: float) -> float:
    """Heat lost through the radiator, which the thermostat opens linearly over its span."""
    return (
        min(max((t_cl_degc - th.thermostat_open_degc) / th.thermostat_span_k, 0.0), 1.0)
        * th.radiator_w_per_k
        * (t_cl_degc - th.t_amb_degc)
    )


def cabin_w(th: Thermal, t_cl_degc: float) -> float:
    """Heat taken by the cabin, Q_heat, faded in between two coolant temperatures."""
    return th.cabin_heat_w * min(
        max(
            (t_cl_degc - th.cabin_heat_from_degc)
            / (th.cabin_heat_full_degc - th.cabin_heat_from_degc),
            0.0,
        ),
        1.0,
    )


def cooling_w(th: Thermal, t_cl_degc: float, speed_mps: float) -> float:
    """All heat that leaves the coolant: to the air, through the radiator, into the cabin."""
    return air_w(th, t_cl_degc, speed_mps) + radiator_w(th, t_cl_degc) + cabin_w(th, t_cl_degc)


def engine_w(th: Thermal, fuel_w: float, p_eng_w: float) -> float:
    """Heat of the engine into the coolant, (1 - x) (Q_fuel - P_eng): the rest is exhaust."""
    return (1.0 - th.exhaust_share) * (fuel_w - p_eng_w)


FUNCTIONS: tuple[Callable[..., float], ...] = (
    ua_w_per_k,
    air_w,
    radiator_w,
    cabin_w,
    cooling_w,
    engine_w,
)


def in_arithmetic(**functions: Callable[..., Any]) -> dict[str, Any]:
    """Return the functions of this module with a different `min` and `max`, by name."""
    namespace: dict[str, Any] = dict(functions)
    for function in FUNCTIONS:
        namespace[function.__name__] = FunctionType(function.__code__, namespace)
    return namespace
