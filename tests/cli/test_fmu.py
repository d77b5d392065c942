"""``qpmpc fmu``: what it writes, and what it refuses."""

import re
from pathlib import Path
from zipfile import ZipFile

import pytest

from qpmpc.codegen.c_compiler import compiler

NEEDS_COMPILER = pytest.mark.skipif(compiler() is None, reason="no C compiler on this machine")


@NEEDS_COMPILER
def test_a_controller_and_its_plant_are_written_and_named(cli, trip, tmp_path):
    for part, fmi, options in (
        ("controller", "2", ("--controller", "mh-costate", "--precision", "f32")),
        ("plant", "3", ("--part", "plant", "--vehicle", "prius-liion")),
    ):
        file = tmp_path / f"{part}.fmu"
        done = cli("fmu", file, "--cycle", trip, "--fmi", fmi, *options)
        assert (done.code, done.err) == (0, "")
        assert done.out.startswith(f"{file}: FMI {fmi}.0 co-simulation, steps of 1 s, ")
        with ZipFile(file) as archive:
            names = archive.namelist()
            described = archive.read("modelDescription.xml").decode()
        assert f'modelIdentifier="{part}"' in described
        assert any(re.match(rf"binaries/.*/{part}\.\w+$", name) for name in names)
        assert ("sources/buildDescription.xml" in names) == (fmi == "3")
        assert "documentation/licenses/license.txt" in names


@NEEDS_COMPILER
def test_a_setting_reaches_the_plant(cli, tmp_path):
    file = tmp_path / "cold.fmu"
    assert cli("fmu", file, "--part", "plant", "--set", "thermal.t_amb_degc=-12.5").code == 0
    with ZipFile(file) as archive:
        numbers = archive.read("sources/cold_mpc_plant_data.h").decode()
    assert "plant_t_amb_degc = -12.5;" in numbers


@NEEDS_COMPILER
def test_the_name_of_a_users_cycle_stays_text(cli, trip, tmp_path):
    odd = tmp_path / "a<b>&\"c'.csv"
    odd.write_bytes(Path(trip).read_bytes())
    done = cli("fmu", tmp_path / "odd.fmu", "--part", "plant", "--cycle", odd)
    assert (done.code, done.err) == (0, "")
    with ZipFile(tmp_path / "odd.fmu") as archive:
        described = archive.read("modelDescription.xml").decode()
        assert "a&lt;b&gt;&amp;&quot;c'" in described
        assert "a&lt;b&gt;&amp;" in archive.read("documentation/index.html").decode()
        texts = [
            archive.read(n).decode() for n in archive.namelist() if not n.startswith("binaries")
        ]
    assert not any("a<b>" in text for text in texts)


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["one.fmu"], "--part controller needs --cycle CYCLE, the trip that it previews"),
        (["one.zip", "--cycle", "nycc"], "FILE one.zip: the name must be a letter, then"),
        (["1.fmu", "--cycle", "nycc"], "FILE 1.fmu: the name must be a letter, then"),
        (["my-car.fmu", "--cycle", "nycc"], "FILE my-car.fmu: the name must be a letter"),
        (["a.fmu", "--cycle", "nycc", "--fmi", "1"], "unknown version of FMI '1': use one of 2, 3"),
        (["a.fmu", "--part", "car"], "unknown part 'car': use one of controller, plant"),
        (["a.fmu", "--cycle", "nyc"], "nycc"),
        (["a.fmu", "--part", "plant", "--precision", "f32"], "--precision has no effect with"),
        (["a.fmu", "--part", "plant", "--controller", "mh-qp"], "--controller has no effect with"),
        (["a.fmu", "--part", "plant", "--set", "mh_qp.admm.iterations=9"], "has no effect with"),
        (["a.fmu", "--cycle", "nycc", "--controller", "dp"], "unknown generated controller 'dp'"),
        (["a.fmu", "--cycle", "nycc", "--precision", "f16"], "unknown precision 'f16'"),
        (["a.fmu", "--cycle", "nycc", "--set", "mh_qp.solver=piqp"], "generated C has its own"),
        (["there.fmu", "--cycle", "nycc"], "FILE there.fmu: is a directory"),
    ],
)
def test_what_cannot_be_is_one_line(cli, tmp_path, monkeypatch, arguments, line):
    monkeypatch.chdir(tmp_path)
    Path("there.fmu").mkdir()
    done = cli("fmu", *arguments)
    assert (done.code, done.out) == (2, "")
    assert line in done.err
    assert done.err.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["there.fmu"]


def test_a_trip_that_the_car_cannot_do_is_no_preview(cli, tmp_path):
    trip = tmp_path / "trip.csv"
    trip.write_text("time_s,speed_mps\n" + "".join(f"{t},{6 * t}\n" for t in range(11)))
    done = cli("fmu", tmp_path / "a.fmu", "--cycle", trip)
    assert (done.code, done.out) == (2, "")
    assert "demand in W is " in done.err
    assert "beyond what prius-nimh can do" in done.err
    assert done.err.count("\n") == 1


def test_without_a_compiler_it_says_so(cli, tmp_path, monkeypatch):
    monkeypatch.setattr("qpmpc.codegen.c_compiler.compiler", lambda: None)
    done = cli("fmu", tmp_path / "a.fmu", "--part", "plant")
    assert (done.code, done.out) == (1, "")
    assert done.err == (
        "qpmpc: an FMU needs a C compiler: none found (tried $CC, cc, gcc, clang)\n"
    )
    assert not (tmp_path / "a.fmu").exists()
