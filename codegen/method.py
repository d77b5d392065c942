"""The controllers that can be generated as C, each with its values and its twin in Python."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from qpmpc.codegen.controller import decision_of
from qpmpc.codegen.costate_controller import costate_decision_of
from qpmpc.codegen.costate_values import costate_values_of
from qpmpc.codegen.values import Values, values_of
from qpmpc.controllers.base import Controller, Decision
from qpmpc.controllers.mh_costate import MhCostate, MhCostateSettings
from qpmpc.controllers.mh_qp import MhQp
from qpmpc.controllers.receding_horizon import RecedingHorizon
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.preview.horizon import HorizonSettings
from qpmpc.trip import Trip
from qpmpc.vehicle.parameters import Vehicle

Generated = Literal["mh-qp", "mh-costate"]
GENERATED: tuple[Generated, ...] = ("mh-qp", "mh-costate")
ITERATIONS: dict[Generated, str] = {
    "mh-qp": "mh_qp.admm.iterations",
    "mh-costate": "mh_costate.rounds",
}


@dataclass(frozen=True)
class Method:
    """One controller that can be generated.

    Attributes
    ----------
    name : of the controller
    horizon : its layout
    prepared : whether it plans before the trip
    values : made of a vehicle and the number of blocks, None if the settings have it
    twin : made of a trip, in Python
    decision : of an `mpc_out`
    """

    name: Generated
    horizon: HorizonSettings
    prepared: bool
    values: Callable[[Vehicle, int | None], Values]
    twin: Callable[[Trip], Controller]
    decision: Callable[[Any], Decision]

    @classmethod
    def of(cls, name: Generated, settings: ControllerSettings) -> "Method":
        """Return the method of a controller with these settings."""
        rules = settings.rule_based
        if name == "mh-costate":
            own = settings.of("mh_costate", MhCostateSettings())
            return cls(
                name,
                own.horizon,
                True,
                lambda vehicle, blocks: costate_values_of(vehicle, own, rules, blocks),
                lambda trip: RecedingHorizon(trip, MhCostate(trip, settings)),
                costate_decision_of,
            )
        of_qp = settings.mh_qp
        return cls(
            name,
            of_qp.horizon,
            of_qp.prepared,
            lambda vehicle, blocks: values_of(vehicle, of_qp, rules, blocks),
            lambda trip: MhQp(trip, settings),
            decision_of,
        )
