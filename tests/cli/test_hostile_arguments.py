"""Bombs and names that are none: one line, exit code 2, before any time is spent."""

from pathlib import Path
from time import perf_counter

import pytest
from hostile_inputs import os_text

LATIN = os_text(b"caf\xe9")  # as Python has the bytes of a name that are not UTF-8
LONG = "a" * 100_000
SET = ["simulate", "nycc", "--set"]
BASE = "name = 'mine'\nbase = 'prius-nimh'\n"

ARGUMENTS = {
    "cycle: latin": (["simulate", f"{LATIN}.csv"], ["caf\\udce9.csv", "not UTF-8"]),
    "cycle: latin, no file": (["simulate", LATIN], ["caf\\udce9", "nycc"]),
    "cycle: long": (["simulate", f"{LONG}.csv"], ["aaa...", "too long", "255"]),
    "cycle: long, no file": (["simulate", LONG], ["aaa...", "nycc"]),
    "cycle: null": (["cycles", "a\0.csv"], ["a\\0.csv", "null"]),
    "cycle: endless": (["simulate", "/dev/zero"], ["/dev/zero", "larger than 64 MB"]),
    "vehicle: latin": (["vehicles", f"{LATIN}.toml", "--toml"], ["caf\\udce9.toml", "not UTF-8"]),
    "vehicle: long": (["simulate", "nycc", "--vehicle", f"{LONG}.toml"], ["aaa...", "too long"]),
    "controller: latin": (["simulate", "nycc", "--controller", LATIN], ["caf\\udce9", "mh-qp"]),
    "controller: long": (["compare", "nycc", "--controllers", LONG], ["aaa...", "mh-qp"]),
    "key: latin": ([*SET, f"thermal.{LATIN}=1"], ["caf\\udce9", "t_amb"]),
    "key: long": ([*SET, f"{LONG}=1"], ["aaa...", "names start with"]),
    "key: deep": ([*SET, f"thermal.{'a.' * 50_000}a=1"], ["t_amb_degc"]),
    "key: long section": ([*SET, f"x.{LONG}=1"], ["aaa...", "thermal"]),
    "key: an old one": ([*SET, "mh_qp.osqp.rho\n0=0.5"], ["'mh_qp.osqp.rho\\n0'"]),
    "value: arrays": ([*SET, f"trip.soc_init={'[' * 60_000}"], ["soc_init"]),
    "value: tables": (
        [*SET, f"trip.soc_init={'{a=' * 9_000}"],
        ["soc_init"],
    ),
    "value: key": (
        [*SET, f"trip.soc_init={{{'a.' * 50_000}a=1}}"],
        ["soc_init"],
    ),
    "value: digits": ([*SET, f"trip.soc_init={'9' * 90_000}"], ["soc_init"]),
    "value: lines": ([*SET, "trip.soc_init=0.6\na=1"], ["'0.6\\na=1'"]),
    "value: latin": ([*SET, f"trip.soc_init={LATIN}"], ["soc_init"]),
    "out: latin": (["simulate", "nycc", "--out", LATIN], ["--out caf\\udce9", "not UTF-8"]),
    "out: long": (["simulate", "nycc", "--out", "a/" * 3000], ["--out a/a/", "too long"]),
    "json: latin": (["simulate", "nycc", "--json", LATIN], ["--json caf\\udce9", "not UTF-8"]),
    "json: long": (["compare", "nycc", "--json", "a" * 256], ["--json aaa", "too long"]),
    "command: long": ([LONG], ["aaa..."]),
    "option: long": (["simulate", "nycc", f"--{LONG}"], ["--aaa", "..."]),
    "option: escape": (["simulate", "nycc", "--a\x1b[31m"], ["--a\\x1b[31m"]),
    "log level: long": (["--log-level", LONG, "cycles"], ["aaa...", "debug"]),
    "folder: latin": (["codegen", LATIN], ["caf\\udce9", "not UTF-8"]),
}
FILES = {
    "arrays": (f"{BASE}[chassis]\nmass_kg = {'[' * 100_000}", ["not valid TOML", "deeper"]),
    "tables": (f"{BASE}x = {'{a = ' * 100_000}", ["not valid TOML", "deeper"]),
    "key": (f"{BASE}{'a.' * 400_000}a = 1", ["not valid TOML", "deeper"]),
    "quoted key": (BASE + '"a" . ' * 100_000 + "a = 1", ["not valid TOML", "deeper"]),
    "header": (f"{BASE}[{'a.' * 400_000}a]", ["not valid TOML", "deeper"]),
    "keys": (BASE + "".join(f"a{'.a' * 30}.x{i} = 1\n" for i in range(3000)), ["unknown a"]),
    "base": (f"name = 'x'\nbase{'.a' * 30} = 1", ["base must be the name"]),
    "digits": (f"{BASE}[chassis]\nmass_kg = {'9' * 900_000}", ["not valid TOML"]),
    "hexadecimal": (f"{BASE}[chassis]\nmass_kg = 0x{'f' * 900_000}", ["chassis.mass_kg"]),
    "line": (f"{BASE}description = '{'x' * 900_000}'", ["description", "at most 1000 characters"]),
    "array": (f"{BASE}[battery]\nsoc_grid = [{'0.5, ' * 100_000}]", ["at most 1000 entries"]),
    "size": ("#" * 1_000_001, ["car.toml", "larger than 1 MB"]),
    "null": (f"{BASE}description = 'a\0b'", ["car.toml", "plain text"]),
}


@pytest.fixture(autouse=True)
def no_run(monkeypatch, tmp_path):
    def run(*_, **__):
        raise AssertionError("must be found before any run")

    monkeypatch.setattr("qpmpc.simulation.drive", run)
    monkeypatch.setattr("qpmpc.comparison.drive", run)
    monkeypatch.chdir(tmp_path)


def refused_soon(cli, args, words) -> None:
    before, start = list(Path().iterdir()), perf_counter()
    done = cli(*args)
    assert perf_counter() - start < 10.0
    done.assert_refused(*words)
    assert len(done.err) < 1000
    assert done.err.rstrip("\n").isprintable()
    assert list(Path().iterdir()) == before


@pytest.mark.parametrize("what", ARGUMENTS)
def test_arguments(cli, what):
    refused_soon(cli, *ARGUMENTS[what])


@pytest.mark.parametrize("what", FILES)
def test_vehicle_files(cli, what):
    text, words = FILES[what]
    Path("car.toml").write_text(text)
    refused_soon(cli, ["simulate", "nycc", "--vehicle", "car.toml"], words)


def test_a_cycle_of_one_endless_line(cli):
    Path("trip.csv").write_text("time_s,speed_mps\n" + "1" * 30_000_000)
    refused_soon(cli, ["simulate", "trip.csv"], ["trip.csv"])
