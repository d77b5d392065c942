"""The generator: same input, same bytes; every number from the settings; refusals in one line."""

import hashlib
import re
from pathlib import Path

import pytest

from qpmpc.codegen.generate import generate, project_files
from qpmpc.codegen.values import CONSTANTS, Values, values_of
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.errors import InputError
from qpmpc.vehicle import load_vehicle


def values(**overrides: object) -> Values:
    chosen = {key.replace("__", "."): value for key, value in overrides.items()}
    settings = ControllerSettings().with_settings(chosen)
    return values_of(load_vehicle(), settings.mh_qp, settings.rule_based)


def digest(folder: Path) -> dict[str, str]:
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.iterdir()}


@pytest.mark.parametrize("target", ["host", "cortex-m7"])
@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_same_input_gives_the_same_bytes(tmp_path, target, precision) -> None:
    generate(values(), tmp_path / "a", target, precision)
    generate(values(), tmp_path / "b", target, precision)
    assert digest(tmp_path / "a") == digest(tmp_path / "b")
    names = {p.name for p in (tmp_path / "a").iterdir()}
    assert {"README.md", "NOTICE", "Makefile", "mpc.h", "mpc_data.c"} <= names


def test_settings_reach_the_code() -> None:
    files = project_files(
        values(
            mh_qp__admm__iterations=33,
            mh_qp__admm__rho=0.25,
            mh_qp__horizon__blocks=4,
            mh_qp__qp__slack_g_per_k=7.5,
            rule_based__min_on_s=9,
        ),
        "host",
        "f64",
    )
    config, data = files["mpc_config.h"], files["mpc_data.c"]
    assert "#define MPC_ITERATIONS 33 " in config
    assert "#define MPC_BLOCKS 4\n" in config
    assert ".rho = 0.25," in data
    assert ".rho_equality = 250.0," in data
    assert ".slack_g_per_k = 7.5," in data
    assert ".rule_min_on_s = 9," in data


def test_the_limits_of_the_engine_reach_the_code() -> None:
    limits = {"start_energy_j": 3.5e3, "min_on_s": 12, "min_off_s": 2, "ramp_w_per_s": 9.5e3}
    limits["electric_max_mps"] = 31.0
    car = load_vehicle().with_settings({f"engine.{key}": value for key, value in limits.items()})
    settings = ControllerSettings()
    numbers = values_of(car, settings.mh_qp, settings.rule_based)
    data = project_files(numbers, "host", "f64")["mpc_data.c"]
    for line in (
        ".start_energy_j = 3500.0,",
        ".ramp_w_per_s = 9500.0,",
        ".electric_max_mps = 31.00001,",
        ".min_on_s = 12,",
        ".min_off_s = 2,",
        ".rule_min_on_s = 12,",  # the longer of the rules' own, 5 s, and the engine's
    ):
        assert line in data


def test_constants_shared_with_python_are_defined_by_the_generator_alone() -> None:
    files = project_files(values(), "host", "f64")
    generated = files.pop("mpc_constants.h")
    code = "".join(files.values())
    for names in CONSTANTS.values():
        for name, value in names.items():
            found = re.findall(rf"^#define {name} \((.+)\)$", generated, re.MULTILINE)
            assert [float(text) for text in found] == [value], name
            assert re.search(rf"\b{name}\b", code), f"{name} is not used"
    written_by_hand = ["mpc_qp.c", "mpc_safety.c", "mpc_step.c", "mpc_admm.c"]
    defined = {n for f in written_by_hand for n in re.findall(r"#define (\w+) ", files[f])}
    assert not defined & {name for names in CONSTANTS.values() for name in names}


def test_no_path_or_date_of_this_machine_in_the_code() -> None:
    text = "".join(project_files(values(), "cortex-m7", "f32").values())
    assert str(Path.home()) not in text
    assert "__DATE__" not in text


def test_single_precision_code_has_no_double_constant() -> None:
    data = project_files(values(), "host", "f32")["mpc_data.c"]
    counts = {str(count) for count in values().counts.values()}
    numbers = [line.split("=")[1].strip(" ,;") for line in data.splitlines() if " = " in line]
    numbers = [n for n in numbers if n[0] in "-0123456789" and n not in counts]
    assert len(numbers) > 40
    assert all(n.endswith("f") for n in numbers)


@pytest.mark.parametrize(
    ("target", "precision", "message"),
    [("z80", "f32", "unknown target 'z80'"), ("host", "f16", "unknown precision 'f16'")],
)
def test_unknown_names_are_refused(tmp_path, target, precision, message) -> None:
    with pytest.raises(InputError, match=message):
        generate(values(), tmp_path / "out", target, precision)
    assert not (tmp_path / "out").exists()


def test_open_number_of_blocks_is_refused() -> None:
    with pytest.raises(InputError, match=r"horizon\.blocks"):
        values(mh_qp__horizon__blocks=0)


def test_terminal_band_without_width_is_refused() -> None:
    # OSQP would treat such a row as an equality, with another step size
    with pytest.raises(InputError, match="no band"):
        values(mh_qp__qp__terminal_low=1.0, mh_qp__qp__terminal_high=1.0)
