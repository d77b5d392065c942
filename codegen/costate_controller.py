"""The generated C controller of `mh-costate` behind the Python API of any controller."""

from typing import Any

from qpmpc.codegen.controller import GeneratedController, decision_of
from qpmpc.codegen.costate_values import costate_values_of
from qpmpc.codegen.generate import Precision
from qpmpc.controllers.base import Controller, Decision
from qpmpc.controllers.mh_costate import MhCostateSettings
from qpmpc.controllers.settings import SettingsLike
from qpmpc.pwa.model import PwaModel
from qpmpc.trip import Trip


class GeneratedCostate(GeneratedController):
    """`mh-costate` in C on this machine, for one trip; several may run side by side.

    Parameters
    ----------
    trip, settings : as of `Controller`
    precision : of all arithmetic

    Raises
    ------
    InputError, CodegenError
        As of `GeneratedController`.
    """

    name = "mh-costate"
    Settings = MhCostateSettings

    def __init__(
        self, trip: Trip, settings: SettingsLike | None = None, precision: Precision = "f64"
    ) -> None:
        Controller.__init__(self, trip, settings)
        own = self.own_settings()
        assert isinstance(own, MhCostateSettings)
        self.solver_name = f"costate newton {precision}"
        blocks = own.horizon.block_count(trip.forecast.steps)
        values = costate_values_of(trip.vehicle, own, self.settings.rule_based, blocks)
        self._build(values, precision, own.horizon, PwaModel.of(trip.vehicle), prepared=True)

    def _decision(self) -> Decision:
        return costate_decision_of(self._out)


def costate_decision_of(out: Any) -> Decision:
    """Return the content of an `mpc_out` of the costate method."""
    decision = decision_of(out)
    nothing = float("nan")
    certificate_g = float(out.relaxation_gap) if out.rung == 0 else nothing
    return decision._replace(relaxation_gap=nothing, certificate_g=certificate_g)
