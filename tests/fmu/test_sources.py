"""The sources in an FMU build, declare what the standard declares, and hold no variable."""

import re
import subprocess
from ctypes import CDLL
from pathlib import Path
from zipfile import ZipFile

import fmpy
import pytest

from qpmpc.codegen.c_compiler import compiler
from qpmpc.codegen.fmu.export import export_fmu
from qpmpc.codegen.parts.part import controller_part, plant_part
from qpmpc.controllers.settings import ControllerSettings

STANDARD = Path(fmpy.__file__).parent / "c-code"
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Wdouble-promotion")
FUNCTION = re.compile(
    r"^FMI\d_Export fmi\w+TYPE\s+(fmi\w+);|^\s+FMI2_Export fmi\w+TYPE\s+(fmi\w+);", re.M
)


def build(folder, *arguments):
    result = subprocess.run(
        [compiler(), *arguments], cwd=folder, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
    return result


def unpacked(file, folder):
    with ZipFile(file) as archive:
        archive.extractall(folder)
    return folder / "sources"


def listed(file):
    """The C files that the description names."""
    description = fmpy.read_model_description(file)
    (configuration,) = description.buildConfigurations
    return configuration.sourceFileSets[0].sourceFiles


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_several_link_into_one_program(fmus, tmp_path, fmi):
    """Without a warning, and without a name that both have."""
    for what in ("controller", "plant"):
        file = fmus[f"{what}{fmi}"]
        sources = unpacked(file, tmp_path / what)
        names = listed(file)
        assert sorted(names) == sorted(path.name for path in sources.glob("*.c"))
        prefix = f"-DFMI{fmi}_FUNCTION_PREFIX={what}_"
        build(sources, *STRICT, "-Werror", "-O0", "-fPIC", "-c", prefix, *names)
    objects = [str(path) for path in tmp_path.glob("*/sources/*.o")]
    build(tmp_path, "-shared", "-o", "both.so", *objects, "-lm")
    library = CDLL(str(tmp_path / "both.so"))
    version = f"fmi{fmi}GetVersion"
    assert hasattr(library, f"controller_{version}")
    assert hasattr(library, f"plant_{version}")
    assert not hasattr(library, version)


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_functions_are_those_of_the_standard(fmus, tmp_path, fmi):
    """All of co-simulation are there, with the arguments of the standard's own header."""
    header = STANDARD / f"fmi{fmi}Functions.h"
    sources = unpacked(fmus[f"plant{fmi}"], tmp_path)
    own = f"PLANT{fmi}_MPC_FMI{fmi}_H"  # its guard: our declarations are left out
    refuse = f"fmi{fmi}Status plant{fmi}_mpc_fmi{fmi}_refuse(void *c, const char *why);"
    (tmp_path / "first.h").write_text(
        f'#include "{header}"\n#define {own}\n#define EXPORT\n#define STATUS fmi{fmi}Status\n'
        f"#define NAME(name) name\n{refuse}\n"
    )
    names = [name for name in listed(fmus[f"plant{fmi}"]) if f"mpc_fmi{fmi}" in name]
    assert len(names) == 2
    build(sources, "-std=c99", "-fsyntax-only", "-include", str(tmp_path / "first.h"), *names)
    (library,) = tmp_path.glob("binaries/*/*.so")
    has = CDLL(str(library))
    declared = {name or other for name, other in FUNCTION.findall(header.read_text("utf-8"))}
    assert len(declared) > 40
    of_exchange = {f"fmi2{name}" for name in EXCHANGE} if fmi == "2" else set()
    assert {name for name in declared if not hasattr(has, name)} == of_exchange
    assert not hasattr(has, f"plant{fmi}_mpc_plant_step")  # the rest is hidden


# functions of FMI 2.0 for model exchange, which a slave need not have
EXCHANGE = (
    *("EnterEventMode", "NewDiscreteStates", "EnterContinuousTimeMode", "CompletedIntegratorStep"),
    *("SetTime", "SetContinuousStates", "GetDerivatives", "GetEventIndicators"),
    *("GetContinuousStates", "GetNominalsOfContinuousStates"),
)


@pytest.mark.parametrize("what", ["controller2", "controller3", "plant2"])
def test_no_variable_is_outside_an_instance(fmus, tmp_path, what):
    """Nothing that is written lies in static memory."""
    sources = unpacked(fmus[what], tmp_path)
    build(sources, "-std=c99", "-O0", "-fno-pic", "-c", *listed(fmus[what]))
    objects = [str(path) for path in sources.glob("*.o")]
    found = subprocess.run(["nm", *objects], capture_output=True, text=True, check=True).stdout
    assert re.search(r" [Rr] ", found)
    assert re.findall(r" [BbDdCcSs] \w+", found) == []


def test_a_controller_that_learns_reads_fuel(trip):
    """And no other has an input for it."""
    settings = ControllerSettings().with_settings({"mh_qp.learning": True})
    learns, does_not = controller_part(trip, "mh-qp", settings), controller_part(trip, "mh-qp")
    inputs = [{v.name for v in p.variables if v.role == "input"} for p in (learns, does_not)]
    assert inputs[0] - inputs[1] == {"fuel_g"}
    assert "#define MPC_LEARNING 1" in learns.sources["mpc_config.h"]


def test_the_same_input_is_the_same_file(tmp_path, trip):
    for folder in ("one", "two"):
        export_fmu(plant_part(trip.vehicle, trip), tmp_path / folder / "plant.fmu", "3")
    one, two = ((tmp_path / folder / "plant.fmu").read_bytes() for folder in ("one", "two"))
    assert one == two
