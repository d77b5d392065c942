"""Vehicle files: shipped ones load, bad ones get one clear line."""

from importlib import resources

import pytest

from qpmpc.errors import InputError
from qpmpc.settings import parse_setting, parse_settings
from qpmpc.vehicle import load_vehicle, vehicle_names


def _text() -> str:
    return (resources.files("qpmpc.vehicle") / "data" / "prius-nimh.toml").read_text("utf-8")


def test_shipped_vehicles_load_and_the_default_comes_first():
    assert vehicle_names() == ("prius-nimh", "prius-liion")
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
        ("soc_init = 0.6", "soc_init = 0.95", "soc_init"),
        ("power_discharge_max_w = 27000.0", "power_discharge_max_w = 60000.0", "power_discharge"),
        ("torque_speed_rpm = [1000,", "torque_speed_rpm = [9000,", "torque_speed_rpm"),
        ("[chassis]", "[chassis", "TOML"),
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


def test_missing_files_and_unknown_names_say_what_is_allowed(tmp_path):
    with pytest.raises(InputError, match="prius-nimh"):
        load_vehicle("prius")
    with pytest.raises(InputError, match="No such file"):
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
