"""Names and texts of files, on the terminal and in what is written; outputs that are no files."""

import json
import os
import pty
import re
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from hostile import AS_SHOWN, TEXT, is_harmless
from pages import assert_self_contained

OWN_STYLE = re.compile(r"\x1b\[[0-9;?]*[mKAhl]")  # colours, and the cursor of a progress bar


@pytest.fixture
def hostile_trip(trip) -> Path:
    return trip.rename(trip.with_name(f"{TEXT}.csv"))


@pytest.fixture
def hostile_car(tmp_path) -> Path:
    file = tmp_path / "car.toml"
    file.write_text(
        'base = "prius-nimh"\nname = "mine"\n# \x9b1m \u202e\n'
        'description = "*/ int evil; /* \\u001b[31m \x9b \u202e\\n<script> $(evil) `evil`"\n',
        "utf-8",
    )
    return file


def in_terminal(*args: object) -> str:
    """What a terminal gets from `qpmpc`, without the styles that are its own."""
    command = [sys.executable, "-m", "qpmpc", *map(str, args)]
    process, terminal = pty.fork()
    if process == 0:
        os.environ.update(TERM="xterm", COLUMNS="150")
        os.execv(sys.executable, command)
    received = b""
    try:
        while part := os.read(terminal, 65536):
            received += part
    except OSError:  # the other end is closed
        pass
    finally:
        os.close(terminal)
    assert os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]) in (0, 2)
    return OWN_STYLE.sub("", received.decode()).replace("\r", "")


def test_terminal_with_table_bar_and_remarks(hostile_trip, hostile_car, tmp_path):
    text = in_terminal(
        *("compare", hostile_trip, "--controllers", "rule-based,ecms"),
        *("--vehicle", hostile_car, "--out", tmp_path / TEXT),
    )
    assert is_harmless(text)
    assert "0:00:0" in text  # the bar was there
    assert f"{AS_SHOWN}, ecms (2/2)" in text
    assert f"{AS_SHOWN}/compare.html written" in text


def test_terminal_with_the_file_of_a_vehicle(hostile_car):
    assert is_harmless(in_terminal("vehicles", hostile_car, "--toml"))


def test_lists_and_errors(cli, hostile_trip, hostile_car):
    for args in (
        ["cycles", hostile_trip],
        ["vehicles", hostile_car],
        ["simulate", f"{TEXT}.missing.csv"],
        ["simulate", "nycc", "--set", f"{TEXT}=1"],
        ["simulate", "nycc", "--set", f"thermal.t_amb_degc={TEXT}"],
        ["simulate", "nycc", "--controller", TEXT],
        ["simulate", "nycc", f"--{TEXT}"],
        ["codegen", f"{hostile_car}/{TEXT}"],
        ["codegen", "x", "--prefix", TEXT],
    ):
        done = cli(*args)
        assert done.code == (0 if args[0] in ("cycles", "vehicles") else 2)
        assert is_harmless(done.out + done.err), args
        assert done.code == 0 or done.err.count("\n") == 1


@pytest.mark.parametrize(
    "text",
    [
        "time_s,speed_mps,\x1b[31m\u202e\n0,0\n1,0\n",
        "time_s,speed_mps\n0,0\n1,\x1b[31m\u202e\n",
        'time_s,speed_mps\n0,0\n1,"a\nb"\n',
    ],
)
def test_content_of_a_bad_trip_is_shown_harmless(cli, tmp_path, text):
    (tmp_path / "trip.csv").write_text(text, "utf-8")
    done = cli("simulate", tmp_path / "trip.csv")
    done.assert_refused("trip.csv")
    assert is_harmless(done.err)


@pytest.mark.parametrize(
    "text",
    [
        'base = "prius-nimh"\nname = "\\u001b[31m\\n"\n',
        'base = "prius-nimh"\nname = "*/ int evil; /*"\n',
        'base = "\\u001b[31m\\n"\nname = "x"\n',
        'base = "prius-nimh"\nname = "x"\n"\\u001b[31m\\n" = 1\n',
        'base = "prius-nimh"\nname = "x"\n[trip]\nsoc_init = "\\u001b\\n"\n',
        'base = "prius-nimh"\nname = "x"\n\u202e = 1\n',
    ],
)
def test_content_of_a_bad_vehicle_is_shown_harmless(cli, tmp_path, text):
    (tmp_path / "car.toml").write_text(text, "utf-8")
    for args in (["simulate", "nycc", "--vehicle"], ["codegen", tmp_path / "c", "--vehicle"]):
        done = cli(*args, tmp_path / "car.toml")
        done.assert_refused("car.toml")
        assert is_harmless(done.err)
    assert not (tmp_path / "c").exists()


def test_reports_and_json(cli, strict_json, hostile_trip, hostile_car, tmp_path):
    folder = tmp_path / "out"
    done = cli(
        *("compare", hostile_trip, "--controllers", "rule-based", "--vehicle", hostile_car),
        *("--out", folder, "--json", "-"),
    )
    assert done.code == 0
    assert is_harmless(done.out)
    assert is_harmless(done.err)
    assert strict_json(done.out)["runs"][0]["cycle"] == TEXT  # as data it is what it was
    page = (folder / "compare.html").read_text("utf-8")
    assert is_harmless(page)
    charts = assert_self_contained(page).charts
    assert charts[0]["panels"][1]["label"].startswith("rule-based")
    assert "<b>" not in page
    assert AS_SHOWN.replace("<b>", "&lt;b&gt;") in page
    assert (folder / f"{TEXT}.png").stat().st_size > 1000  # "$x^$" would be a broken formula


def test_a_name_that_is_no_text(cli, trip, tmp_path):
    odd = trip.rename(trip.with_name(os.fsdecode(b"odd\xff.csv")))
    done = cli("compare", odd, "--controllers", "rule-based", "--out", tmp_path / "out")
    assert done.code == 2
    assert r"odd\udcff.csv: the name is not UTF-8" in done.err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("algorithm", ["admm", "osqp"])
@pytest.mark.parametrize("target", ["host", "cortex-m7"])
def test_no_text_of_a_vehicle_but_its_name_reaches_generated_files(
    cli, hostile_car, tmp_path, target, algorithm
):
    folder = tmp_path / "c"
    options = ("--target", target, "--algorithm", algorithm, "--precision", "f64")
    assert cli("codegen", folder, "--vehicle", hostile_car, *options).code == 0
    plain = tmp_path / "plain"
    assert cli("codegen", plain, "--vehicle", "prius-nimh", *options).code == 0
    for file in folder.rglob("*"):
        if file.is_file():
            text = file.read_text("utf-8")
            assert "evil" not in text
            same = text.replace("mine", "prius-nimh")
            assert same == (plain / file.relative_to(folder)).read_text("utf-8").replace(
                "mine", "prius-nimh"
            )
    numbers = re.findall(r"^    \.\w+ = (.*),$", (folder / "mpc_data.c").read_text(), re.M)
    assert len(numbers) > 50
    for number in numbers:
        assert re.fullmatch(r"-?\d+(\.\d+)?(e[-+]?\d+)?|\{", number), number


def simulate(*args: object, stdout: object = subprocess.PIPE) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "qpmpc", "simulate", *map(str, args)]
    command += ["--controller", "rule-based"]
    return subprocess.run(command, stdout=stdout, stderr=subprocess.PIPE, text=True, timeout=60)


def test_json_through_a_fifo_and_a_link(cli, strict_json, trip, tmp_path):
    fifo, link = tmp_path / "fifo", tmp_path / "link.json"
    os.mkfifo(fifo)
    link.symlink_to("target.json")
    read: list[str] = []
    reader = threading.Thread(target=lambda: read.append(fifo.read_text()))
    reader.start()
    assert cli("simulate", trip, "--controller", "rule-based", "--json", fifo).code == 0
    reader.join(timeout=10)
    assert strict_json(read[0])["cycle"] == "short"
    assert fifo.is_fifo()
    assert cli("simulate", trip, "--controller", "rule-based", "--json", link).code == 0
    assert link.is_symlink()
    assert strict_json((tmp_path / "target.json").read_text())["cycle"] == "short"


def test_entries_of_out_that_are_links_and_fifos_stay(cli, strict_json, trip, tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "short_rule-based.csv").symlink_to(tmp_path / "kept.csv")
    (folder / "short_rule-based.png").symlink_to("/dev/null")
    os.mkfifo(folder / "short_rule-based.json")
    read: list[str] = []
    reader = threading.Thread(
        target=lambda: read.append((folder / "short_rule-based.json").read_text())
    )
    reader.start()
    assert cli("simulate", trip, "--controller", "rule-based", "--out", folder).code == 0
    reader.join(timeout=10)
    assert strict_json(read[0])["cycle"] == "short"
    assert (folder / "short_rule-based.csv").is_symlink()
    assert (tmp_path / "kept.csv").read_text().startswith("time_s,")
    assert (folder / "short_rule-based.png").readlink() == Path("/dev/null")
    assert Path("/dev/null").is_char_device()


def test_a_full_device_is_one_line(cli, trip, tmp_path):
    (tmp_path / "full").symlink_to("/dev/full")
    done = cli("simulate", trip, "--controller", "rule-based", "--json", tmp_path / "full")
    assert done.code == 1
    assert done.err == f"qpmpc: {tmp_path / 'full'}: No space left on device\n"


def test_dev_stdout_is_the_standard_output_wherever_it_leads(trip, tmp_path):
    piped = simulate(trip, "--json", "/dev/stdout")
    with (tmp_path / "log").open("w") as log:
        log.write("before\n")
        log.flush()
        simulate(trip, "--json", "/dev/stdout", stdout=log)
    logged = (tmp_path / "log").read_text()
    assert logged.startswith("before\n{")
    for text in (piped.stdout, logged.removeprefix("before\n")):
        data, end = json.JSONDecoder().raw_decode(text)
        assert data["cycle"] == "short"
        assert "balanced g" in text[end:]  # the table, after it
