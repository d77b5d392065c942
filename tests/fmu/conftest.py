"""FMUs of controller and plant, exported once for the tests of this folder."""

from pathlib import Path

import pytest

from qpmpc.codegen.c_compiler import compiler
from qpmpc.codegen.fmu.export import export_fmu
from qpmpc.codegen.fmu.parts import controller_part, plant_part
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.trip import Trip

pytest.importorskip("fmpy", reason="not installed: fmpy, which simulates FMUs")

from fmus import CONTROLLERS


@pytest.fixture(scope="session")
def trip() -> Trip:
    return Trip("nycc")


@pytest.fixture(scope="session")
def fmus(tmp_path_factory: pytest.TempPathFactory, trip: Trip) -> dict[str, Path]:
    """Controller and plant by version of FMI: controller2, plant2, controller3, plant3."""
    if compiler() is None:
        pytest.skip("no C compiler on this machine")
    folder = tmp_path_factory.mktemp("fmus")
    files = {}
    for fmi, name in CONTROLLERS.items():
        parts = {
            "controller": controller_part(trip, ControllerSettings(), name, "f64"),
            "plant": plant_part(trip.vehicle, trip),
        }
        for what, part in parts.items():
            file = files[f"{what}{fmi}"] = folder / f"{what}{fmi}.fmu"
            export_fmu(part, file, fmi)
    return files
