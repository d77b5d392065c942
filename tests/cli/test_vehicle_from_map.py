"""`qpmpc vehicle-from-map`."""

import json

from qpmpc.vehicle import load_vehicle


def test_command(tmp_path, cli):
    file, out = tmp_path / "engine.csv", tmp_path / "my-car.toml"
    file.write_text("power_kw,efficiency\n2,0.2\n5,0.29\n10,0.35\n25,0.38\n50,0.37\n60,0.35\n")
    done = cli("vehicle-from-map", file, "--out", out, "--json", tmp_path / "figures.json")
    assert done.code == 0, done.err
    assert "60.0 kW, best 38.0% at 25 kW" in done.out
    figures = json.loads((tmp_path / "figures.json").read_text())
    assert figures["vehicle"] == "my-car"
    assert figures["points"] == 6
    assert load_vehicle(out).name == "my-car"
    assert out.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    refused = cli("vehicle-from-map", file, "--out", tmp_path / "car.txt")
    refused.assert_refused("--out", ".toml")


def test_a_curve_that_is_not_convex_is_said_to_be(tmp_path, cli):
    file, out = tmp_path / "engine.csv", tmp_path / "bent.toml"
    file.write_text("power_kw,fuel_g_per_s\n0,0.1\n10,0.63\n20,1.1\n40,2.3\n")
    made = cli("vehicle-from-map", file, "--out", out)
    assert "up to 5 % of fuel below it, at 10 kW" in made.out
    assert "not convex: up to 5.00% above its convex envelope" in " ".join(
        cli("vehicles", out).out.split()
    )
    curve = tmp_path / "curve.csv"
    curve.write_text("power_kw,fuel_g_per_s\n0,0.1\n10,0.6\n20,1.2\n40,2.6\n")
    cli("vehicle-from-map", curve, "--out", out)
    assert "not convex" not in cli("vehicles", out).out


def test_no_file_is_written_over_another_and_nothing_by_halves(tmp_path, cli):
    file, out = tmp_path / "engine.csv", tmp_path / "car.toml"
    text = "power_kw,efficiency\n2,0.2\n5,0.29\n10,0.35\n60,0.35\n"
    file.write_text(text)
    for args in (("--json", file), ("--json", out), ("--json", out.with_suffix(".png"))):
        cli("vehicle-from-map", file, "--out", out, *args).assert_refused("files of their own")
    same = tmp_path / "same.toml"
    same.write_text(text)
    cli("vehicle-from-map", same, "--out", same).assert_refused("files of their own")
    assert file.read_text() == same.read_text() == text
    out.with_suffix(".png").mkdir()
    cli("vehicle-from-map", file, "--out", out).assert_refused("car.png")
    cli("vehicle-from-map", file, "--out", tmp_path / "my car.toml").assert_refused("--name")
    assert not out.exists()
