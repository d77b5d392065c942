"""The text of a vehicle's file: complete, loads back equal, keeps the comments that are true."""

import tomllib
from importlib import resources

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from strategies import differences

from qpmpc.shown import shown
from qpmpc.vehicle import load_vehicle, vehicle_file_text, vehicle_names, vehicle_toml
from qpmpc.vehicle.toml_text import comments_of


def shipped_text(name):
    return (resources.files("qpmpc.vehicle") / "data" / f"{name}.toml").read_text("utf-8")


@pytest.mark.parametrize("base", vehicle_names())
@given(changes=differences())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_what_is_written_loads_back_equal(tmp_path, base, changes):
    vehicle = load_vehicle(base).with_settings(changes)
    path = tmp_path / "mine.toml"
    path.write_text(vehicle_toml(vehicle), "utf-8")
    assert load_vehicle(path) == vehicle


@pytest.mark.parametrize("name", vehicle_names())
def test_the_text_of_a_shipped_vehicle_is_complete_and_loads_back(tmp_path, name):
    text = vehicle_file_text(name)
    path = tmp_path / "copy.toml"
    path.write_text(text, "utf-8")
    assert load_vehicle(path) == load_vehicle(name)
    data = tomllib.loads(text)
    assert "base" not in data
    assert {key: set(value) for key, value in data.items() if isinstance(value, dict)} == {
        key: {name for name, number in value.items() if number is not None}
        for key, value in load_vehicle(name).model_dump().items()
        if isinstance(value, dict)
    }
    assert max(map(len, vehicle_toml(load_vehicle(name)).splitlines())) <= 100


def test_a_file_without_base_is_printed_as_it_is(tmp_path):
    assert vehicle_file_text("prius-nimh") == shipped_text("prius-nimh")
    path = tmp_path / "mine.toml"
    path.write_text(shipped_text("prius-nimh").rstrip(), "utf-8")
    assert vehicle_file_text(str(path)) == shipped_text("prius-nimh")


def test_comments_of_the_values_that_count_are_kept():
    """Those of the base, but not where the file on top has another value."""
    text = vehicle_file_text("prius-liion")
    merged, own, base = (
        comments_of(t) for t in (text, shipped_text("prius-liion"), shipped_text("prius-nimh"))
    )
    assert merged[""].above[:3] == own[""].above
    assert merged[""].above[3:] == (
        "# Written out in full from prius-liion, whose base is prius-nimh.",
    )
    for key, comment in base.items():
        if key not in own and not key.startswith("battery."):
            assert merged[key] == comment
    assert merged["battery.capacity_ah"].beside == "# S 56 cells, 207.2 V nominal"
    assert merged["battery.soc_min"].beside == "# S the paper"
    assert "ADVISOR NiMH" not in text


def test_a_changed_value_loses_the_comment_of_the_base(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('base = "prius-nimh"\nname = "x"\n[chassis]\nmass_kg = 2000\n')
    lines = vehicle_file_text(str(path)).splitlines()
    assert "mass_kg = 2000.0" in lines
    assert "rotating_mass_factor = 1.02  # A" in lines


def test_comments_of():
    text = """# head
# more

# not of the name
name = "a # b"  # beside \\ "quoted"
description = 'it is "#1"'

[engine] # of a table
# above
# and above
power_max_w = 1.0#close
torque_max_nm = [
  1.0,  # of an entry, which has no key
  # in the array
]
# \u2028 is no end of line
start_fuel_g = 0 # last
"""
    found = comments_of(text)
    assert tomllib.loads(text)["name"] == "a # b"
    assert found[""].above == ("# head", "# more", "# not of the name")
    assert found["name"].beside == '# beside \\ "quoted"'
    assert "description" not in found
    assert found["engine"].beside == "# of a table"
    assert found["engine.power_max_w"].above == ("# above", "# and above")
    assert found["engine.power_max_w"].beside == "#close"
    assert "engine.torque_max_nm" not in found
    assert found["engine.start_fuel_g"].above == ("# \u2028 is no end of line",)


@given(
    comment=st.text(st.characters(exclude_categories=["Cs", "Cc"]), max_size=30),
    text=st.text(st.characters(exclude_categories=["Cs", "Cc"], exclude_characters="'")),
)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_comment_and_any_text_leave_a_file_that_loads_back(tmp_path, comment, text):
    path, copy = tmp_path / "mine.toml", tmp_path / "copy.toml"
    path.write_text(
        f"#{comment}\nbase = 'prius-liion' #{comment}\n#{comment}\nname = 'x'#{comment}\n"
        f"description = '''{text}\nname = 3 # {text}\n[trip] # no table\n'' ''' #{comment}\n"
        f"[trip] #{comment}\nsoc_init = 0.5 #{comment}\n",
        "utf-8",
    )
    copy.write_text(vehicle_file_text(str(path)), "utf-8")
    assert load_vehicle(copy) == load_vehicle(path)
    written = shown(f"#{comment}".rstrip())
    assert comments_of(copy.read_text("utf-8"))["trip.soc_init"].beside == written


def test_a_path_that_is_no_comment(tmp_path):
    path, copy = tmp_path / "a\nb = 1\x01.toml", tmp_path / "copy.toml"
    path.write_text('base = "prius-nimh"\nname = "x"\n')
    copy.write_text(vehicle_file_text(str(path)))
    assert load_vehicle(copy) == load_vehicle(path)
