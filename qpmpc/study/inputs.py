"""The files that a study names, read once, and its check before the first run."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from hashlib import sha256

from qpmpc.cycles import Cycle, load_cycle
from qpmpc.cycles.load import CYCLES
from qpmpc.cycles.trips import SETS, is_trip, make_trip
from qpmpc.errors import InputError
from qpmpc.faults.models import Faults, load_faults
from qpmpc.names import unknown
from qpmpc.preview.forecast_errors import MODELS
from qpmpc.registry import check_controllers, split_settings
from qpmpc.remarks import say_once
from qpmpc.study.definition import OF_RUN, TRUE_FORECAST, Study, with_seed
from qpmpc.vehicle import Vehicle, load_vehicle
from qpmpc.vehicle.belief import with_settings
from qpmpc.vehicle.names import DEFAULT_VEHICLE, VEHICLES

CACHED = 64


@dataclass(frozen=True)
class Inputs:
    """What a user's files hold, by their names: it travels to the workers, the files do not.

    Attributes
    ----------
    cycles, vehicles, faults : by the names that the study gives
    """

    cycles: Mapping[str, Cycle] = field(default_factory=dict)
    vehicles: Mapping[str, Vehicle] = field(default_factory=dict)
    faults: Mapping[str, Faults] = field(default_factory=dict)

    def cycle(self, name: str) -> Cycle:
        """Return a cycle of a file, shipped or generated."""
        return self.cycles[name] if name in self.cycles else _cycle(name)

    def vehicle(self, name: str) -> Vehicle:
        """Return a vehicle of a file or shipped."""
        return self.vehicles[name] if name in self.vehicles else _vehicle(name)

    def content_hash(self) -> str:
        """Hash all of it."""
        digest = sha256()
        for name, cycle in sorted(self.cycles.items()):
            digest.update(name.encode() + cycle.speed_mps.tobytes() + cycle.grade.tobytes())
        for name, vehicle in sorted(self.vehicles.items()):
            digest.update(f"{name}{vehicle.model_dump_json()}".encode())
        for name, faults in sorted(self.faults.items()):
            digest.update(f"{name}{[fault.model_dump_json() for fault in faults]}".encode())
        return digest.hexdigest()[:32]


@lru_cache(CACHED)
def _cycle(name: str) -> Cycle:
    return load_cycle(name)


@lru_cache(CACHED)
def _vehicle(name: str) -> Vehicle:
    return load_vehicle(name)


def read_inputs(study: Study) -> Inputs:
    """Read the files of a study and check all that it names, before any run.

    Raises
    ------
    InputError
        If a name or value cannot be used; the combinations of values are checked by their runs.
    """
    controllers = [str(name) for name in study.values_of("controller")] or ["mh-qp"]
    check_controllers(controllers)
    vehicles = [str(name) for name in study.values_of("vehicle")] or [DEFAULT_VEHICLE]
    loaded = {name: load_vehicle(name) for name in vehicles}
    cycles = {}
    for name in (with_seed(str(value), 0) for value in study.values_of("cycle")):
        if name in CYCLES or not is_trip(name):
            cycles[name] = load_cycle(name)
        elif not name.startswith(tuple(SETS)):
            make_trip(name)  # refuses a wrong duration
    for remark in (remark for cycle in cycles.values() for remark in cycle.remarks):
        say_once(remark)
    for forecast in study.values_of("forecast"):
        if forecast not in (TRUE_FORECAST, *MODELS):
            raise InputError(unknown("forecast", str(forecast), (TRUE_FORECAST, *MODELS)))
    _check_settings(study, controllers, list(loaded.values()))
    return Inputs(
        {name: cycle for name, cycle in cycles.items() if name not in CYCLES},
        {name: vehicle for name, vehicle in loaded.items() if name not in VEHICLES},
        {str(name): load_faults(str(name)) for name in study.values_of("faults")},
    )


def _check_settings(study: Study, controllers: list[str], vehicles: list[Vehicle]) -> None:
    """Check every point, and every value of every other setting, the rest at their first."""
    points = [{k: v for k, v in p.items() if k not in OF_RUN} for p in study.points] or [{}]
    of_points = {key for point in points for key in point}
    others = [key for key in study.settings if key not in of_points]
    first = {key: study.values_of(key)[0] for key in others}
    each = [{**points[0], **first, key: v} for key in others for v in study.values_of(key)]
    for together in [*({**first, **point} for point in points), *each]:
        of_vehicle, _ = split_settings(together, controllers)
        for vehicle in vehicles if of_vehicle else []:
            with_settings(vehicle, None, of_vehicle)
