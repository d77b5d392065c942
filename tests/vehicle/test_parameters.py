"""Vehicle files: shipped ones load, bad ones get one clear line."""

import math
from importlib import resources

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel

from qpmpc.controllers.settings import ControllerSettings
from qpmpc.errors import InputError
from qpmpc.settings import parse_setting, parse_settings
from qpmpc.vehicle import Vehicle, load_vehicle, vehicle_names


def _text() -> str:
    return (resources.files("qpmpc.vehicle") / "data" / "prius-nimh.toml").read_text("utf-8")


def test_shipped_vehicles_load_and_the_default_comes_first():
    assert vehicle_names() == (
        "prius-nimh",
        "prius-liion",
        "prius-prime",
        "sonata-hybrid",
        "paper-liion",
        "paper-nimh",
    )
    for name in vehicle_names():
        assert load_vehicle(name).name == name


def test_a_vehicle_file_loads_like_the_shipped_one(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(_text())
    assert load_vehicle(path) == load_vehicle()


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("mass_kg = 1530.9", "mass_kg = -1", "chassis.mass_kg"),
        ("mass_kg = 1530.9", "mass_kg = nan", "chassis.mass_kg"),
        ("mass_kg = 1530.9", "weight_kg = 1530.9", "weight_kg"),
        ("soc_min = 0.4 ", "soc_min = 0.9 ", "soc_min"),
        ("start_energy_j = 0.0", "start_energy_j = 13501.0", "engine.start_energy_j"),
        ("min_on_s = 4 ", "min_on_s = 4.5 ", "engine.min_on_s"),
        ("min_off_s = 2 ", "min_off_s = 601 ", "engine.min_off_s"),
        ("ramp_w_per_s = 11833.0", "ramp_w_per_s = 0.0", "engine.ramp_w_per_s"),
        ("soc_init = 0.6", "soc_init = 0.95", "soc_init"),
        ("power_discharge_max_w = 20500.0", "power_discharge_max_w = 60000.0", "power_discharge"),
        ("torque_speed_rpm = [1000,", "torque_speed_rpm = [9000,", "torque_speed_rpm"),
        ("[chassis]", "[chassis", "TOML"),
        ("mass_kg = 1530.9", f"mass_kg = {'9' * 5000}", "TOML"),
        ("mass_kg = 1530.9", f"mass_kg = {'[' * 5000}", "TOML"),
        ("mass_kg = 1530.9", f"mass_kg = 0x{'f' * 5000}", "chassis.mass_kg"),
    ],
)
def test_bad_values_are_named_in_one_line(tmp_path, old, new, named):
    path = tmp_path / "bad.toml"
    assert old in _text()
    path.write_text(_text().replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        load_vehicle(path)
    assert named in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_without_limits_of_starts_has_none(tmp_path):
    path = tmp_path / "older.toml"
    keys = ("start_energy_j", "min_on_s", "min_off_s", "ramp_w_per_s")
    path.write_text("".join(x for x in _text().splitlines(True) if not x.startswith(keys)))
    engine = load_vehicle(path).engine
    free = (0.0, 0, 0, 1e6)
    assert (engine.start_energy_j, engine.min_on_s, engine.min_off_s, engine.ramp_w_per_s) == free


def test_an_engine_reaches_its_least_power_in_the_second_of_a_start():
    load_vehicle().with_settings({"engine.power_min_w": 2e3, "engine.ramp_w_per_s": 2e3})
    with pytest.raises(InputError, match="ramp_w_per_s must reach power_min_w, 2000 W"):
        load_vehicle().with_settings({"engine.power_min_w": 2e3, "engine.ramp_w_per_s": 1999})


def test_missing_files_and_unknown_names_say_what_is_allowed(tmp_path):
    with pytest.raises(InputError, match="prius-nimh"):
        load_vehicle("prius")
    with pytest.raises(InputError, match="no such file"):
        load_vehicle(tmp_path / "none.toml")


def test_settings_reach_every_section_and_are_checked():
    vehicle = load_vehicle().with_settings({"thermal.t_amb_degc": -15, "trip.soc_init": 0.55})
    assert (vehicle.thermal.t_amb_degc, vehicle.trip.soc_init) == (-15.0, 0.55)
    with pytest.raises(InputError, match="t_amb_degc"):
        load_vehicle().with_settings({"thermal.t_amb": -15})
    with pytest.raises(InputError, match="given: 900"):
        load_vehicle().with_settings({"thermal.t_amb_degc": 900})


def test_settings_texts():
    assert parse_setting("thermal.t_amb_degc=-15") == ("thermal.t_amb_degc", -15)
    assert parse_settings(["a.b=1", "a.b=2"]) == {"a.b": 2}
    for text in ("a.b", "=1", "a.b="):
        with pytest.raises(InputError, match="KEY=VALUE"):
            parse_setting(text)


NUMBERS = [
    (section, key)
    for section, values in load_vehicle().model_dump(exclude={"name", "description"}).items()
    for key, value in values.items()
    if isinstance(value, float)
]
TABLES = [
    (section, key)
    for section, values in load_vehicle().model_dump(exclude={"name", "description"}).items()
    for key, value in values.items()
    if isinstance(value, tuple)
]
NOT_NUMBERS = [True, False, "1", "nan", math.nan, math.inf, -math.inf, None, [1.0], 10**400]


@pytest.mark.parametrize(("section", "key"), NUMBERS)
def test_only_finite_numbers_are_numbers(section, key):
    """Without strictness pydantic takes True for 1 and "1" for 1."""
    for wrong in NOT_NUMBERS:
        # None is "not given", which is allowed of an engine that is described otherwise
        with pytest.raises(InputError, match=f"{section}.*{key}"):
            load_vehicle().with_settings({f"{section}.{key}": wrong})


@pytest.mark.parametrize(("section", "key"), TABLES)
def test_only_finite_numbers_are_entries(section, key):
    values = list(load_vehicle().model_dump()[section][key])
    for wrong in NOT_NUMBERS:
        with pytest.raises(InputError, match=rf"{section}.{key}\[1\]: must be"):
            load_vehicle().with_settings({f"{section}.{key}": [values[0], wrong, *values[2:]]})
    for wrong in (True, 1.0, "1, 2", values[:1], values * 500):
        with pytest.raises(InputError, match=f"{section}.{key}: must"):
            load_vehicle().with_settings({f"{section}.{key}": wrong})


def test_whole_numbers_and_those_of_numpy_are_numbers():
    for number in (25, 25.0, np.float64(25.0), np.float32(25.0), np.int64(25)):
        warm = load_vehicle().with_settings({"thermal.t_amb_degc": number})
        assert type(warm.thermal.t_amb_degc) is float
        assert warm.thermal.t_amb_degc == 25.0
    with pytest.raises(InputError, match="given: true"):
        load_vehicle().with_settings({"thermal.t_amb_degc": np.bool_(True)})
    fewer = ControllerSettings().with_settings({"mh_qp.admm.iterations": np.int64(25)})
    assert fewer.mh_qp.admm.iterations == 25
    resistance = 0.5 * np.array(load_vehicle("prius-liion").battery.resistance_charge_ohm)
    better = load_vehicle("prius-liion").with_settings(
        {"battery.resistance_charge_ohm": resistance}
    )
    assert better.battery.resistance_charge_ohm == tuple(resistance)


def test_settings_of_controllers_are_as_strict():
    for key, wrong in [
        ("mh_qp.admm.iterations", True),
        ("mh_qp.admm.rho", True),
        ("mh_qp.admm.rho", "0.1"),
        ("mh_qp.horizon.class_hard_w", math.inf),
        ("mh_qp.prepared", 1),
        ("rule_based.heat_on_degc", math.nan),
    ]:
        with pytest.raises(InputError, match=key):
            ControllerSettings().with_settings({key: wrong})


def test_every_table_of_settings_is_strict():
    seen, waiting = set(), [Vehicle, ControllerSettings]
    while waiting:
        model = waiting.pop()
        seen.add(model)
        config = model.model_config
        for key, value in {"frozen": True, "extra": "forbid", "strict": True}.items():
            assert config.get(key) == value, model
        assert config.get("allow_inf_nan") is False, model
        kinds = [field.annotation for field in model.model_fields.values()]
        waiting += [k for k in kinds if isinstance(k, type) and issubclass(k, BaseModel)]
    assert len(seen) >= 15


@given(name=st.from_regex(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}", fullmatch=True))
def test_names_that_are_allowed(name):
    assert load_vehicle().with_settings({"name": name}).name == name


@pytest.mark.parametrize(
    "name",
    ["", " ", "a b", "a/b", "../x", ".x", "-x", "_x", "x\n", "x\0", "Größe", "a" * 65, 3, True],
)
def test_names_that_are_not(name):
    with pytest.raises(InputError, match="name: must") as caught:
        load_vehicle().with_settings({"name": name})
    assert "\n" not in str(caught.value)
