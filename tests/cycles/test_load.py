"""Names, files, and what is wrong with users' files."""

import os
import re
from collections.abc import Callable
from pathlib import Path
from threading import Thread

import numpy as np
import pytest

from qpmpc.cycles import Cycle, cycle_names, load_cycle
from qpmpc.cycles.logs.read import MEGABYTES_MAX
from qpmpc.cycles.plausibility import GAP_MAX_S, GAP_STANDING_MAX_S
from qpmpc.errors import InputError

Write = Callable[[str | bytes], Path]
HEADER = "time_s,speed_mps\n"
GOOD = HEADER + "0,0\n1,1\n2,2\n3,3\n4,3\n"
ALLOWED = re.escape("time_s,speed_mps[,grade]")


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def write(text: str | bytes) -> Path:
        path = tmp_path / "trip.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


def as_csv(cycle: Cycle, factor: float = 1.0) -> str:
    rows = zip(cycle.time_s, factor * cycle.speed_mps, strict=True)
    return HEADER + "".join(f"{t:.0f},{v:.5f}\n" for t, v in rows)


def refused(path: Path, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        load_cycle(path)
    text = str(caught.value)
    assert "\n" not in text
    assert text.startswith(str(path))


def test_unknown_name_lists_the_names() -> None:
    with pytest.raises(InputError, match=r"unknown cycle 'nyc'.*nycc.*wltc-3b.*CSV"):
        load_cycle("nyc")


@pytest.mark.parametrize("name", ["a" * 50_000, "a\0b", "caf\udce9"])
def test_impossible_name(name: str) -> None:
    with pytest.raises(InputError, match="unknown cycle") as caught:
        load_cycle(name)
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize(
    ("path", "reason"),
    [
        ("a" * 300 + ".csv", "too long: at most 255 bytes a name"),
        ("x/" * 3000 + "a.csv", "too long: .* 4095 in all"),
        ("a\0b.csv", "null"),
        ("caf\udce9.csv", "not UTF-8: rename it"),
    ],
)
def test_impossible_path(path: str, reason: str) -> None:
    with pytest.raises(InputError, match=reason) as caught:
        load_cycle(path)
    assert len(str(caught.value)) < 300
    assert str(caught.value).isprintable()


def test_a_file_too_large_is_refused_before_it_is_read_as_a_table(tmp_path: Path) -> None:
    path = tmp_path / "trip.csv"
    with path.open("wb") as file:
        file.truncate(MEGABYTES_MAX * 1_000_000 + 1)
    refused(path, f"larger than {MEGABYTES_MAX} MB")


def test_a_trip_through_a_pipe(tmp_path: Path) -> None:
    """As of a shell's <(command)."""
    pipe = tmp_path / "trip.csv"
    os.mkfifo(pipe)
    writer = Thread(target=pipe.write_text, args=[GOOD])
    writer.start()
    np.testing.assert_array_equal(load_cycle(pipe).speed_mps, [0, 1, 2, 3, 3])
    writer.join()


def test_name_of_a_file_is_its_stem(write: Write) -> None:
    cycle = load_cycle(write(GOOD))
    assert cycle.name == "trip"
    np.testing.assert_array_equal(cycle.speed_mps, [0, 1, 2, 3, 3])
    np.testing.assert_array_equal(cycle.grade, np.zeros(5))
    assert load_cycle(str(write(GOOD))).steps == 4


@pytest.mark.parametrize(
    "text",
    [
        b"\xef\xbb\xbf" + GOOD.encode(),
        GOOD.replace("\n", "\r\n"),
        GOOD + "\n\n  \n,\n",
        GOOD.rstrip("\n"),
        GOOD.replace("time_s,speed_mps", " time_s , speed_mps "),
        GOOD.replace(",", " , "),
        '"time_s","speed_mps"\n' + GOOD.removeprefix(HEADER),
        "speed_mps,time_s\n0,10\n1,11\n2,12\n3,13\n3,14\n",
        HEADER + "0,0\n0.5,0.5\n3,3\n4.0,3\n4.9,0\n",
        HEADER + "1700000000,0\n1700000003,3\n1700000004,3\n",
    ],
    ids=[
        *("bom", "crlf", "blank-end", "no-final-newline", "header-spaces", "spaces", "quotes"),
        *("column-order", "uneven", "unix-time"),
    ],
)
def test_harmless_variations(write: Write, text: str | bytes) -> None:
    np.testing.assert_allclose(load_cycle(write(text)).speed_mps, [0, 1, 2, 3, 3], atol=1e-9)


def test_grade_is_read_and_resampled(write: Write) -> None:
    cycle = load_cycle(write("time_s,speed_mps,grade\n0,5,0\n4,5,0.04\n"))
    np.testing.assert_allclose(cycle.grade, [0, 0.01, 0.02, 0.03, 0.04])
    np.testing.assert_allclose(cycle.step_grade, [0.005, 0.015, 0.025, 0.035])


def test_drive_may_start_and_end_at_speed(write: Write) -> None:
    cycle = load_cycle(write(HEADER + "0,20\n5,25\n"))
    assert cycle.speed_mps[0] == 20
    assert cycle.speed_mps[-1] == 25


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("0,0\n1,x\n2,2\n3,3\n", "line 3: speed_mps is 'x', must be a finite number"),
        ("0,0\n1,\n2,2\n3,3\n", "line 3: speed_mps is '', must be"),
        ("0,0\n1,nan\n2,2\n3,3\n", "line 3: speed_mps is 'nan', must be"),
        ("0,0\n1,inf\n2,2\n3,3\n", "line 3: speed_mps is 'inf', must be"),
        ("0,0\nnan,1\n2,2\n3,3\n", "line 3: time_s is 'nan', must be"),
        (f"0,0\n1,{'z' * 500}\n", "line 3: speed_mps is 'z{37}\\.{3}', must be"),
        ("0,0\n1,1\n\n3,3\n", "line 4: a blank line, but the header has 2 columns"),
        ("0,0\n1,1\n2,2,0.1\n3,3\n", "line 4: 3 value.s., but the header has 2 columns"),
        ("0,0\n1,1\n2\n3,3\n", "line 4: 1 value.s., but the header has 2 columns"),
        ("0,0\n1,-0.1\n2,0\n3,0\n", "line 3: speed_mps is -0.1, must not be negative"),
        ("0,0\n1,1\n1,2\n3,3\n", "line 4: 25% of the rows have the time of the row before"),
        ("0,0\n2,1\n1,2\n3,3\n", "line 4: time_s is 1, must increase strictly"),
        ("0,60\n1,65\n2,71\n3,71\n", "line 4: speed_mps is 71, must be 0 to 70.*km/h by 3.6"),
        ("0,0\n1,1\n2,12\n3,12\n", "line 4: the speed changes by 11.0 m/s .* at most 10 "),
        ("0,12\n1,12\n2,0\n3,0\n", "line 4: the speed changes by -12.0 m/s"),
        ("0,0\n1,1\n13,5\n14,5\n", "line 4: 12 s without a sample, at most 10 s"),
        ("0,0\n1,1\n2,2\n", "the trip lasts 2 s, must be 3 s to 24 h"),
        ("0,0\n90000,0\n", "the trip lasts 90000 s, must be 3 s to 24 h"),
        ("0,0\n", "1 row.s. below the header, at least 2"),
        ("", "0 row.s. below the header, at least 2"),
    ],
)
def test_bad_rows(write: Write, rows: str, message: str) -> None:
    refused(write(HEADER + rows), message)


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ("time_s", f"found: 'time_s'; .*allowed: {ALLOWED}$"),
        ("time_s,speed_mps,speed_mps", "each column needs a name of its own"),
        ("0,0", "columns found: '0,0'"),
        (",".join("abcdefghij" * 20), r"found: '.{77}\.\.\.'"),
    ],
)
def test_bad_columns(write: Write, header: str, message: str) -> None:
    refused(write(f"{header}\n0,0\n1,1\n2,2\n3,3\n"), f"line 1: .*{message}")


def test_grade_in_percent(write: Write) -> None:
    text = "time_s,speed_mps,grade\n0,5,0\n1,5,4\n2,5,4\n3,5,4\n"
    refused(write(text), r"line 3: grade is 4, must be -0\.3 to 0\.3, .*divide percent by 100")


@pytest.mark.parametrize("text", [b"", b"\n\n", b"\xef\xbb\xbf"])
def test_empty_file(write: Write, text: bytes) -> None:
    refused(write(text), "the file is empty")


@pytest.mark.parametrize("content", [bytes(range(256)), GOOD.encode("utf-16"), b"a,b\0c\n1,2\n"])
def test_binary_file(write: Write, content: bytes) -> None:
    refused(write(content), "must be plain text in UTF-8")


def test_missing_file_and_directory(tmp_path: Path) -> None:
    refused(tmp_path / "absent.csv", "no such file")
    refused(tmp_path, "is a directory")


def test_gap_while_the_car_stands_is_filled(write: Write) -> None:
    """A logger that sleeps at a red light, up to the longest one."""
    gap_s = GAP_STANDING_MAX_S
    cycle = load_cycle(write(HEADER + f"0,4\n2,0\n{2 + gap_s},0\n{4 + gap_s},4\n"))
    assert cycle.duration_s == gap_s + 4
    assert cycle.distance_m == 8


@pytest.mark.parametrize(
    ("rows", "gap"),
    [
        # an hour at cruise: 90 km would be invented
        ("0,25\n1,25\n3601,25\n3602,25\n", "line 4: 3600 s"),
        ("0,0\n1,1\n13,1\n14,1\n", "line 4: 12 s"),
        ("0,0\n1,0\n13,9\n14,9\n", "line 4: 12 s"),
        # parked overnight: engine and cabin would be kept warm
        ("0,5\n5,0\n6,0\n30006,0\n30010,5\n", "line 5: 30000 s"),
        ("0,5\n5,0\n306,0\n307,0\n", "line 4: 301 s"),
    ],
)
def test_longer_gaps_are_refused_with_the_way_out(write: Write, rows: str, gap: str) -> None:
    refused(
        write(HEADER + rows),
        f"{gap} without a sample, at most {GAP_MAX_S:g} s are allowed, {GAP_STANDING_MAX_S:g} s "
        "standing: .*if these are two trips, qpmpc convert --split makes a file of each",
    )


@pytest.mark.parametrize("name", cycle_names())
def test_genuine_cycles_pass(write: Write, name: str) -> None:
    cycle = load_cycle(name)
    again = load_cycle(write(as_csv(cycle)))
    np.testing.assert_allclose(again.speed_mps, cycle.speed_mps, atol=1e-5)


@pytest.mark.parametrize("name", cycle_names())
@pytest.mark.parametrize("factor", [3.6, 1 / 0.44704], ids=["kmh", "mph"])
def test_wrong_unit_is_noticed(write: Write, name: str, factor: float) -> None:
    text = as_csv(load_cycle(name), factor)
    refused(write(text), "divide km/h by 3.6 or multiply mph by 0.44704")


@pytest.mark.parametrize("factor", [1.3, 1.5])
@pytest.mark.parametrize("name", cycle_names())
def test_aggressive_driving_passes(write: Write, name: str, factor: float) -> None:
    """Specific power up to 1.5^2 = 2.25 times that of the regulations' cycles is still driving.

    The US06, EPA's aggressive schedule, has 2.0 times that of the WLTC (26 against 13 W/kg).
    """
    assert load_cycle(write(as_csv(load_cycle(name), factor))).steps == load_cycle(name).steps


def test_short_sprint_passes_with_a_remark(write: Write) -> None:
    """A sports car: 0 to 50 m/s (180 km/h) at 5 m/s^2, up to 250 W/kg."""
    speed = np.concatenate([np.linspace(0, 50, 11), np.linspace(50, 0, 11)])
    rows = "".join(f"{k},{v}\n" for k, v in enumerate(speed))
    cycle = load_cycle(write(HEADER + rows))
    assert cycle.distance_m > 500
    (remark,) = cycle.remarks
    assert "226 W/kg accelerating (above 26), 238 W/kg braking (above 45), 5 m/s^2" in remark


def test_steady_motorway_in_mph_is_noticed(write: Write) -> None:
    refused(write(HEADER + "".join(f"{k},65\n" for k in range(600))), "mean speed .* is 65, must")
