"""Everything wrong with a file is said at once, in a line of bounded length."""

import tomllib
from importlib import resources

import pytest
from hypothesis import given
from hypothesis import strategies as st

from qpmpc.errors import InputError
from qpmpc.settings import validated
from qpmpc.vehicle import Vehicle


def shipped():
    file = resources.files("qpmpc.vehicle") / "data" / "prius-nimh.toml"
    return tomllib.loads(file.read_text("utf-8"))


def line_of(data):
    with pytest.raises(InputError) as caught:
        validated(Vehicle, data, "my.toml")
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_all_problems_in_one_line():
    data = shipped()
    del data["thermal"]["heat_capacity_j_per_k"], data["battery"]["soc_min"], data["trip"]
    data["engine"]["power_mx_w"] = 1.0
    data["chassis"]["eta_drive"] = True
    data["battery"]["soc_max"] = 1.5
    assert line_of(data) == (
        "my.toml: missing thermal.heat_capacity_j_per_k, battery.soc_min, [trip]; "
        "unknown engine.power_mx_w (did you mean engine.power_max_w?); "
        "chassis.eta_drive: must be a valid number (given: true); "
        "battery.soc_max: must be less than 1 (given: 1.5)"
    )


@pytest.mark.parametrize(
    ("table", "key", "meant"),
    [
        ("chassis", "mas_kg", "chassis.mass_kg"),
        ("chassis", "t_amb_degc", "thermal.t_amb_degc"),
        (None, "eta_eq", "trip.eta_eq"),
        (None, "themal", "thermal"),
        (None, "cold-engine", "cold_engine"),
        ("chassis", "foo", None),
    ],
)
def test_a_misspelt_or_misplaced_key_is_met_with_what_was_meant(table, key, meant):
    data = shipped()
    (data[table] if table else data)[key] = 1.0
    said = f"{table}.{key}" if table else key
    hint = f" (did you mean {meant}?)" if meant else ""
    assert line_of(data) == f"my.toml: unknown {said}{hint}"


def test_wrong_entries_of_an_array_are_not_called_missing_too():
    data = shipped()
    data["battery"]["soc_grid"] = [0.0, True]
    assert line_of(data) == "my.toml: battery.soc_grid[1]: must be a valid number (given: true)"
    data["battery"]["soc_grid"] = [0.0]
    assert line_of(data) == "my.toml: battery.soc_grid: must have at least 2 entries"


def test_of_many_problems_the_first_are_named_and_the_others_counted():
    line = line_of({table: {} for table in ("engine", "battery", "thermal")})
    assert line.startswith("my.toml: missing name, [chassis], engine.power_max_w, ")
    missing = sum(
        field.is_required()
        for table in ("engine", "battery", "thermal")
        for field in Vehicle.model_fields[table].annotation.model_fields.values()
    )
    assert line.endswith(f" and {missing + 4 - 8} more")  # name, chassis, cold_engine, trip


def test_the_line_stays_short_whatever_the_file_says():
    """Three sorts of problems, eight of each, with some 200 characters for each."""
    data = {f"{i}\n" * 1000: i for i in range(1000)}
    data |= {"name": "\n" * 10_000, "chassis": {f"x{i}": "y" * 1000 for i in range(100)}}
    data["engine"] = {"torque_max_nm": ["z" * 1000] * 1000}
    assert len(line_of(data)) < 3 * 8 * 200


leaves = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20)
values = leaves | st.lists(leaves, max_size=4) | st.dictionaries(st.text(max_size=9), leaves)
keys = st.sampled_from([(t, k) for t, v in shipped().items() if isinstance(v, dict) for k in v])


@given(changes=st.dictionaries(keys, values, max_size=6), tables=st.dictionaries(st.text(), values))
def test_any_change_is_accepted_or_refused_in_one_line(changes, tables):
    data = shipped() | tables
    for (table, key), value in changes.items():
        if isinstance(data.get(table), dict):
            data[table][key] = value
    said = ""
    try:
        validated(Vehicle, data, "my.toml")
    except InputError as error:
        said = str(error)
    assert "\n" not in said
    assert not said or said.startswith("my.toml: ")
