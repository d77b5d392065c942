"""FMUs of controller and plant, exported once for all tests, in whichever process they run."""

from pathlib import Path

import pytest

from qpmpc.codegen.c_compiler import compiler
from qpmpc.codegen.fmu.export import export_fmu
from qpmpc.codegen.parts.part import controller_part, plant_part
from qpmpc.trip import Trip

pytest.importorskip("fmpy", reason="not installed: fmpy, which simulates FMUs")

from fmus import CONTROLLERS
from run_folder import run_folder


@pytest.fixture(scope="session")
def trip() -> Trip:
    return Trip("nycc")


class Exported(dict[str, Path]):
    """FMUs by part and version of FMI, `controller2`, `plant3`: made when one is asked for."""

    def __init__(self, folder: Path, trip: Trip) -> None:
        self.folder, self.trip = folder, trip

    def __missing__(self, name: str) -> Path:
        part, fmi = name[:-1], name[-1]
        self[name] = self.folder / f"{name}.fmu"
        if not self[name].exists():  # another process may have made it; it appears as a whole
            made = (
                controller_part(self.trip, CONTROLLERS[fmi])
                if part == "controller"
                else plant_part(self.trip.vehicle, self.trip)
            )
            export_fmu(made, self[name], fmi)
        return self[name]


@pytest.fixture(scope="session")
def fmus(tmp_path_factory: pytest.TempPathFactory, trip: Trip) -> Exported:
    if compiler() is None:
        pytest.skip("no C compiler on this machine")
    return Exported(run_folder(tmp_path_factory, "fmus"), trip)
