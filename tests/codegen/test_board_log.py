"""A board's log: read whole out of noise, or refused in one line that says why."""

import re
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from board_log import IDENTITY, bodies, line, text_of
from hostile_inputs import MANIFEST

from qpmpc.codegen.board.check import BoardResult, Commands, check_commands
from qpmpc.codegen.board.log import read_log
from qpmpc.errors import InputError

GOOD = text_of(bodies())


@pytest.fixture
def read(tmp_path):
    def from_text(text):
        path = tmp_path / "board.log"
        path.write_bytes(text if isinstance(text, bytes) else text.encode("latin-1"))
        return read_log(path)

    return from_text


def test_a_run_is_read_to_the_bit(read) -> None:
    log = read(GOOD)
    assert (log.identity, log.controller, log.precision) == (IDENTITY, "mh-qp", "f32")
    assert (log.unit, log.hz, log.board) == ("cycles", 480_000_000, "my board")
    np.testing.assert_array_equal(log.step, [1_800_000, 1_800_001, 1_800_002, 1_800_003, 1_800_004])
    np.testing.assert_array_equal(log.forecast, [4000, 4001, 4002, 4003, 4004])
    np.testing.assert_array_equal(log.power_w, 100.0)
    assert log.engine_on.all()
    assert (log.slices, log.slice_most, log.stack_bytes, log.ram_bytes) == (
        30,
        2_000_000,
        632,
        70000,
    )
    assert log.remarks == ()


def test_in_double_precision_the_bits_are_those_of_a_double(read) -> None:
    lines = bodies(1)
    lines[0] = lines[0].replace("f32", "f64")
    lines[2] = lines[2].replace("42c80000", "4059000000000001")
    assert read(text_of(lines)).power_w[0] == np.nextafter(100.0, 101.0)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r", "\r\n\r\n"])
def test_any_line_end_will_do(read, end) -> None:
    assert len(read(GOOD.replace("\r\n", end)).step) == 5


def test_noise_before_and_between_is_left_out_and_said(read) -> None:
    lines = GOOD.splitlines(keepends=True)
    lines.insert(4, "[12.5] usb 1-1: new device\r\n")
    boot = b"\xff\xfe\0U-Boot 2024\r\nbooting...\r\n\0\0\x1b[0m"
    log = read(boot + "".join(lines).encode())
    assert len(log.step) == 5
    assert log.remarks == ("3 lines that are not of the log are left out",)


def test_the_last_start_counts(read) -> None:
    """A board that was reset under way, its old run cut off in the middle of a line."""
    first = GOOD[: len(GOOD) // 2]
    log = read(f"{first}\r\n{GOOD}")
    assert len(log.step) == 5
    assert "before its last start" in log.remarks[0]


def with_line(number: int, body: str) -> str:
    lines = bodies()
    lines[number] = body
    return text_of(lines)


def without(*numbers: int) -> str:
    return text_of([body for k, body in enumerate(bodies()) if k not in numbers])


STEP_2 = bodies()[4]
REFUSED = {
    "empty": ("", ["no line QPMPC1,start"]),
    "another file": ("time_s,speed_mps\n0,0\n", ["no line QPMPC1,start"]),
    "no start": (without(0), ["no line QPMPC1,start"]),
    "start damaged": (
        GOOD.replace("mh-qp", "mh-qq"),
        ["no line QPMPC1,start", "line 1", "damaged"],
    ),
    "cut off in a line": (GOOD[:-20], ["line 8 is cut off", "no checksum"]),
    "cut off after a line": (without(7), ["is cut off", "no line 'end'"]),
    "cut off early": (without(5, 6, 7), ["2 of 5 seconds are missing: 3, 4"]),
    "no departure": (without(1), ["no line 'depart'"]),
    "a character changed": (GOOD.replace("1800002", "1800003"), ["line 5 is damaged", "checksum"]),
    "a second missing": (without(4), ["1 of 5 seconds are missing: 2"]),
    "a second twice": (
        text_of([*bodies()[:5], STEP_2, *bodies()[5:]]),
        ["second 2 is there twice: lines 5 and 6"],
    ),
    "two seconds swapped": (
        text_of([*bodies()[:4], bodies()[5], bodies()[4], *bodies()[6:]]),
        ["second 2 out of order"],
    ),
    "too many seconds": (with_line(6, STEP_2.replace(",2,", ",5,", 1)), ["second 5 of 5"]),
    "end first": (text_of([bodies()[0], bodies()[-1], *bodies()[1:-1]]), ["lines out of order"]),
    "two ends": (GOOD + line(bodies()[-1]), ["2 times a line 'end'"]),
    "another format": (GOOD.replace("QPMPC1", "QPMPC2"), ["no line QPMPC1", "format 2"]),
    "a newer line": (GOOD + line("temperature,40"), ["line 9 is none of format 1", "temperature"]),
    "no number": (with_line(4, STEP_2.replace("1800002", "18e5")), ["line 5 is none of format 1"]),
    "nan": (with_line(4, STEP_2.replace("42c80000", "7fc00000")), ["line 5", "not finite"]),
    "wrong width": (
        with_line(4, STEP_2.replace("42c80000", 2 * "42c80000")),
        ["line 5", "8 digits"],
    ),
    "flags": (with_line(4, STEP_2[:-1] + "64"), ["flags above 63"]),
    "unit": (text_of(bodies(unit="hours")), ["line 1", "cycles, ns, instructions"]),
    "no second": (text_of(bodies(0)), ["line 1", "1 second"]),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_a_whole_run_is_refused_in_one_line(read, name) -> None:
    text, words = REFUSED[name]
    with pytest.raises(InputError) as refused:
        read(text)
    message = str(refused.value)
    assert "\n" not in message
    assert message.startswith("--from-log ")
    for word in words:
        assert word in message


def test_every_single_changed_character_of_a_run_is_noticed(read) -> None:
    """CRC-32 finds each error of up to 32 bits in a row; a tag that is changed leaves a gap."""
    lines = GOOD.splitlines(keepends=True)
    for at in range(len(lines[4]) - 2):
        damaged = lines[4][:at] + chr(ord(lines[4][at]) ^ 1) + lines[4][at + 1 :]
        with pytest.raises(InputError):
            read("".join([*lines[:4], damaged, *lines[5:]]))


def test_the_documented_lines_are_of_this_format(read) -> None:
    page = (Path(__file__).parents[2] / "docs" / "embedded.md").read_text("utf-8")
    start, *others = re.findall(r"^QPMPC1,.*$", page, re.MULTILINE)
    assert len(others) >= 3
    # right lines, of a run that is not all there
    with pytest.raises(InputError, match="596 of 598 seconds are missing"):
        read("\n".join([start, *others]))


def compared(precision: str, seconds: int, differing: int, **changed) -> BoardResult:
    """A log whose first seconds have another power than expected."""
    manifest = MANIFEST.model_copy(update={"precision": precision, "seconds": seconds})
    zeros = np.zeros(seconds, dtype=np.int64)
    power_w = np.full(seconds, 20e3)
    expected = Commands(power_w.copy(), power_w > 0.0, zeros, zeros)
    power_w[:differing] = changed.get("power_w", 0.0)
    of_board = {"power_w": power_w, "engine_on": power_w > 0.0, "rung": zeros}
    of_board |= {"precision": precision, "step": zeros + 1, "forecast": zeros}
    of_board["flags"] = np.where(np.arange(seconds) < changed.get("flagged", 0), 4, 0)
    log = SimpleNamespace(**of_board, unit="cycles", remarks=())
    return BoardResult(manifest, log, expected, None)


@pytest.mark.parametrize(
    ("precision", "seconds", "differing", "message"),
    [
        ("f32", 100, 1, ""),  # a tie
        ("f32", 3, 1, ""),
        ("f32", 101, 2, ""),
        ("f32", 100, 2, "engine off, this machine 20000.0 W.* in 2 of 100 seconds, where 1 may be"),
        ("f64", 100, 1, "in 1 of 100 seconds, where 0 may be"),
        ("f64", 100, 0, ""),
    ],
)
def test_only_round_off_may_tell_commands_apart(precision, seconds, differing, message) -> None:
    result = compared(precision, seconds, differing)
    assert len(result.differing) == differing
    with pytest.raises(InputError, match=message) if message else nullcontext():
        check_commands(result, "board.log")


@pytest.mark.parametrize(("precision", "within_w"), [("f32", 1700.0), ("f64", 0.05)])
def test_the_tolerance_is_that_stated(precision, within_w) -> None:
    """3 % and 1e-6 of 57 kW: 1,710 W and 0.057 W."""
    for factor, count in ((1.0, 0), (1.2, 5)):
        result = compared(precision, 100, 5, power_w=20e3 + factor * within_w)
        assert len(result.differing) == count


def test_flags_must_be_equal() -> None:
    with pytest.raises(InputError, match="second 0: the board says rung 0, solver failed"):
        check_commands(compared("f32", 100, 0, flagged=3), "board.log")
