"""The commands that show what is shipped."""

import os
import re
import subprocess
import sys
import tomllib

import pytest

from qpmpc.cycles import catalogue, cycle_names, load_cycle
from qpmpc.pwa.model import PwaModel
from qpmpc.vehicle import load_vehicle, vehicle_names


def test_cycles_shows_measured_beside_published(cli):
    done = cli("cycles")
    assert done.code == 0
    lines = [re.split(r"\s{2,}", line.strip()) for line in done.out.splitlines()]
    measured = {line[0]: line for line in lines if line[0] in cycle_names()}
    assert set(measured) == set(cycle_names())
    for name, line in measured.items():
        assert line[1] == f"{load_cycle(name).steps} s"
    published = [line for line in lines if line[0] == "published"]
    assert len(published) == sum(entry.published is not None for entry in catalogue())
    assert published[0][:3] == ["published", "598 s", "1.18 mi = 1.899 km"]


def test_cycles_name_tells_the_source(cli, tmp_path):
    done = cli("cycles", "nedc-truncated", "--out", tmp_path)
    assert done.code == 0
    assert "Our reading of the truncated NEDC" in done.out
    assert (tmp_path / "cycle_nedc-truncated.png").read_bytes().startswith(b"\x89PNG")


def test_cycles_takes_a_users_file(cli, trip):
    done = cli("cycles", trip)
    assert done.code == 0
    assert "48 s" in done.out


def test_vehicles_lists_the_shipped(cli):
    done = cli("vehicles")
    assert [line.partition(":")[0] for line in done.out.splitlines()] == list(vehicle_names())


def test_vehicles_name_shows_every_parameter_with_its_unit(cli):
    done = cli("vehicles", "prius-liion")
    vehicle = load_vehicle("prius-liion")
    cells = [re.split(r"\s{2,}", line.strip()) for line in done.out.splitlines()]
    shown = {line[0]: line[1:] for line in cells}
    for section, values in vehicle.model_dump(exclude={"name", "description"}).items():
        for key, value in values.items():
            assert (f"{section}.{key}" in shown) == (value is not None)
    assert shown["thermal.t_amb_degc"] == ["-7", "°C"]
    assert shown["chassis.mass_kg"] == [f"{vehicle.chassis.mass_kg:g}", "kg"]
    assert shown["trip.soc_init"] == ["0.6"]


def test_vehicles_name_shows_the_piecewise_affine_models(cli, tmp_path):
    done = cli("vehicles", "prius-nimh", "--out", tmp_path)
    model = PwaModel.of(load_vehicle("prius-nimh"))
    for title, fit, unit in [
        ("fuel", model.fuel, 1.0),
        ("battery at", model.battery, 1e3),
        ("cold multiplier", model.alpha, 1.0),
    ]:
        (line,) = [line for line in done.out.splitlines() if line.startswith(title)]
        assert f" {fit.pieces} " in line
        assert f"{fit.below / unit:.3g}" in line
        assert f"{fit.above / unit:.3g}" in line
    assert (tmp_path / "pwa_prius-nimh.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", vehicle_names())
def test_vehicles_toml_is_the_whole_of_stdout(cli, tmp_path, name):
    done = cli("vehicles", name, "--toml")
    assert (done.code, done.err) == (0, "")
    file = tmp_path / "copy.toml"
    file.write_text(done.out, "utf-8")
    assert load_vehicle(file) == load_vehicle(name)
    assert cli("vehicles", file, "--toml").out == done.out  # complete: it is printed as it is


def test_vehicles_toml_takes_a_users_file(cli, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('base = "prius-liion"\nname = "mine"\ndescription = "Größe"\n', "utf-8")
    merged = tomllib.loads(cli("vehicles", file, "--toml").out)
    assert (merged["name"], merged["description"]) == ("mine", "Größe")
    assert merged["battery"]["capacity_ah"] == load_vehicle("prius-liion").battery.capacity_ah


def test_vehicles_toml_is_utf8_whatever_the_terminal_uses(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('base = "prius-nimh"\nname = "mine"\ndescription = "Größe"\n', "utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "qpmpc", "vehicles", file, "--toml"],
        capture_output=True,
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
    )
    assert done.returncode == 0
    assert tomllib.loads(done.stdout.decode())["description"] == "Größe"
