"""A vehicle on top of a base: merged key by key, and every problem named with its file."""

import pytest
from hypothesis import HealthCheck, given, settings
from strategies import differences, toml_of

from qpmpc.errors import InputError
from qpmpc.vehicle import load_vehicle, vehicle_names


def refusal(path):
    """The one line in which a vehicle file is refused."""
    with pytest.raises(InputError) as caught:
        load_vehicle(path)
    line = str(caught.value)
    assert "\n" not in line
    return line


@pytest.fixture
def write(tmp_path):
    def write(name, text):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
        return path

    return write


def test_the_li_ion_car_is_the_default_one_with_another_battery():
    """Each value as it stood in the file before it had a base."""
    expected = load_vehicle("prius-nimh").model_dump()
    expected["name"] = "prius-liion"
    expected["description"] = "Prius-like power split, 1.8 L, Li-ion 3.6 Ah"
    expected["battery"] = {
        "capacity_ah": 3.6,
        "soc_grid": (0.0, 0.4, 0.8, 1.0),
        "open_circuit_v": (198.0, 204.0, 216.0, 222.0),
        "resistance_discharge_ohm": (0.19, 0.19, 0.19, 0.19),
        "resistance_charge_ohm": (0.19, 0.19, 0.19, 0.19),
        "power_discharge_max_w": 22500.0,
        "power_charge_max_w": 24000.0,
        "derating_share_per_k": 0.01,
        "soc_min": 0.4,
        "soc_max": 0.8,
        "aux_power_w": 400.0,
    }
    assert load_vehicle("prius-liion").model_dump() == expected


@pytest.mark.parametrize("pack", ["nimh", "liion"])
def test_the_cars_of_the_paper_are_the_others_without_winter_and_with_a_free_engine(pack):
    """Each value as it stood when the tables against the paper were made."""
    expected = load_vehicle(f"prius-{pack}").model_dump()
    found = load_vehicle(f"paper-{pack}")
    expected |= {"name": f"paper-{pack}", "description": found.description}
    expected["engine"] |= {
        "start_fuel_g": 0.0,
        "start_energy_j": 0.0,
        "min_on_s": 0,
        "min_off_s": 0,
        "ramp_w_per_s": 1e6,
        "electric_max_mps": 70.0,
    }
    expected["chassis"] |= {
        "eta_drive": 0.88,
        "eta_regen": 0.748,
        "road_load_share_per_k": 0.0,
        "regen_from_mps": 0.0,
        "regen_full_mps": 0.0,
    }
    expected["thermal"]["radiator_w_per_k"] = 150.0
    expected["battery"] |= {
        "power_discharge_max_w": 27e3,
        "power_charge_max_w": 25e3,
        "derating_share_per_k": 0.0,
    }
    assert found.model_dump() == expected


@pytest.mark.parametrize("base", vehicle_names())
@given(changes=differences())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_base_and_what_differs_is_the_base_with_settings(tmp_path, base, changes):
    path = tmp_path / "mine.toml"
    path.write_text(f'base = "{base}"\n' + toml_of(changes), "utf-8")
    assert load_vehicle(path) == load_vehicle(base).with_settings(changes)


def test_bases_are_found_beside_the_file_and_chained(write, monkeypatch, tmp_path):
    write("fleet/van.toml", 'base = "prius-nimh"\nname = "van"\n[chassis]\nmass_kg = 2500\n')
    write("cold/van.toml", 'base = "../fleet/van.toml"\nname = "cold"\n[thermal]\nt_amb_degc = -20')
    top = write("top.toml", 'base = "cold/van.toml"\nname = "top"\n[chassis]\neta_drive = 0.9\n')
    vehicle = load_vehicle(top)
    assert vehicle == load_vehicle().with_settings(
        {
            "name": "top",
            "chassis.mass_kg": 2500.0,
            "thermal.t_amb_degc": -20.0,
            "chassis.eta_drive": 0.9,
        }
    )
    monkeypatch.chdir(tmp_path / "fleet")  # where the reader is does not matter
    assert load_vehicle("../top.toml") == vehicle
    absolute = write("absolute.toml", f'base = "{top}"\nname = "top"\n')
    assert load_vehicle(absolute) == vehicle


def test_a_base_gives_everything_but_the_name(write):
    path = write("mine.toml", 'base = "prius-liion"\n')
    assert refusal(path) == f"{path}: missing name"
    path.write_text('base = "prius-liion"\nname = "mine"\n')
    assert load_vehicle(path).description == load_vehicle("prius-liion").description


def test_an_array_alone_must_fit_those_of_the_base(write):
    path = write("mine.toml", 'base = "prius-nimh"\nname = "x"\n[battery]\nsoc_grid = [0, 1]\n')
    assert refusal(path) == (
        f"{path}: battery: open_circuit_v must have 2 entries, one per grid point "
        "(battery.open_circuit_v in prius-nimh)"
    )


@pytest.mark.parametrize(
    ("base", "words"),
    [
        ('"prius"', ["mine.toml: base: unknown vehicle 'prius'", "prius-nimh, prius-liion"]),
        ('""', ["mine.toml: base: unknown vehicle ''"]),
        ('"none.toml"', ["mine.toml: base: vehicle file", "none.toml: no such file"]),
        ('"a\\u0000.toml"', ["mine.toml: base: vehicle file", "null"]),
        ('"folder.toml"', ["folder.toml: is a directory"]),
        ('"latin.toml"', ["latin.toml: must be plain text in UTF-8"]),
        ('"broken.toml"', ["broken.toml: not valid TOML"]),
        ("3", ["mine.toml: base must be the name", "(given: 3)"]),
        (f"0x{'f' * 9000}", ["mine.toml: base must be the name", "number too long"]),
        ("[]", ["mine.toml: base must be the name"]),
        ("false", ["mine.toml: base must be the name", "(given: false)"]),
    ],
)
def test_a_base_that_cannot_be_had(write, tmp_path, base, words):
    (tmp_path / "folder.toml").mkdir()
    (tmp_path / "latin.toml").write_bytes(b"# \xe4\n")
    write("broken.toml", "name = = 1")
    line = refusal(write("mine.toml", f'base = {base}\nname = "mine"\n'))
    for word in words:
        assert word in line


def test_circles(write, tmp_path):
    path = write("self.toml", 'base = "self.toml"\nname = "self"\n')
    assert refusal(path) == f"{path}: its bases go round in a circle: {path} -> {path}"
    a = write("a.toml", 'base = "x/b.toml"\nname = "a"\n')
    b = write("x/b.toml", 'base = "link.toml"\nname = "b"\n')
    (tmp_path / "x" / "link.toml").symlink_to(a)
    line = refusal(a)
    assert line.startswith(f"{a}: its bases go round in a circle: {a} -> {b} -> ")
    into = write("into.toml", 'base = "a.toml"\nname = "into"\n')
    assert "circle" in refusal(into)


def test_a_wrong_value_of_a_base_is_named_with_its_file(write):
    base = write("base.toml", 'base = "prius-nimh"\nname = "b"\n[chassis]\nmass_kg = -1\nx = 1\n')
    path = write("mine.toml", 'base = "base.toml"\nname = "mine"\n[trip]\neta_eq = 2\n')
    assert refusal(path) == (
        f"{path}: unknown chassis.x in {base}; chassis.mass_kg in {base}: must be greater than or "
        "equal to 500 (given: -1); trip.eta_eq: must be less than 1 (given: 2)"
    )


def test_values_that_do_not_fit_together_are_named_with_their_files(write):
    path = write("mine.toml", 'base = "prius-nimh"\nname = "x"\n[battery]\nsoc_min = 0.9\n')
    assert refusal(path) == (
        f"{path}: battery: soc_min must be below soc_max (battery.soc_max in prius-nimh)"
    )
    path.write_text('base = "prius-nimh"\nname = "x"\n[trip]\nsoc_init = 0.9\n')
    assert refusal(path) == (
        f"{path}: trip.soc_init must lie between battery.soc_min and battery.soc_max, "
        "0.4..0.8 (given: 0.9) (battery.soc_min in prius-nimh, battery.soc_max in prius-nimh)"
    )


def test_a_table_is_no_value_and_a_value_no_table(write):
    path = write("mine.toml", 'base = "prius-nimh"\nname = "x"\nbattery = 3\n')
    assert refusal(path) == f"{path}: battery: must be a table (given: 3)"
    path.write_text('base = "prius-nimh"\nname = "x"\n[chassis.mass_kg]\nvalue = 3\n')
    assert refusal(path) == f"{path}: chassis.mass_kg: must be a valid number"
