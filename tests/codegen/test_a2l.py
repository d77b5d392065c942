"""A2L files and XCP: what a calibration tool reads is what the firmware checks and does."""

import json
import struct
from pathlib import Path

import pytest
from typer.testing import CliRunner

from qpmpc.cli.app import app
from qpmpc.codegen.a2l.description import address_of, described
from qpmpc.codegen.a2l.image import Image
from qpmpc.codegen.a2l.quantities import UNITS
from qpmpc.codegen.calibration import DESCRIBED
from qpmpc.codegen.firmware import Target, generate, make_firmware, missing_tools
from qpmpc.codegen.method import Method
from qpmpc.codegen.pil.calibrated import (
    CalibratedRun,
    Change,
    calibrated_trip,
    drive_calibrated,
)
from qpmpc.codegen.pil.calibrated_report import calibrated_line, calibrated_rows, write_calibrated
from qpmpc.codegen.xcp import XcpError, XcpMaster
from qpmpc.controllers.monitor import Flag
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle, load_cycle
from qpmpc.errors import InputError
from qpmpc.trip import Trip
from qpmpc.vehicle import load_vehicle

MISSING = missing_tools()
pytestmark = pytest.mark.skipif(bool(MISSING), reason=f"not installed: {', '.join(MISSING)}")

VALUES = Method.of("mh-costate", ControllerSettings()).values(load_vehicle(), None)
SECONDS = 130


@pytest.fixture(scope="module")
def elf(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("a2l")
    generate(VALUES, folder, "cortex-m7", "f32")
    return make_firmware(folder, "XCP=1", "CFLAGS=-O1")


@pytest.fixture(scope="module")
def a2l(elf) -> Path:
    file = elf.parent / "controller.a2l"
    done = CliRunner().invoke(app, ["a2l", str(file), "--elf", str(elf)])
    assert done.exit_code == 0, done.output
    assert "28 numbers to set" in done.output
    return file


def test_the_file_read_back_has_the_addresses_and_bounds_of_the_code(a2l, elf) -> None:
    parser = pytest.importorskip("pya2l.parser")
    with parser.A2lParser() as reader:
        module = reader.tree_from_a2l(a2l.read_bytes()).PROJECT.MODULE[0]
    image = Image(elf)
    found = {each.Name.Value: each for each in module.CHARACTERISTIC}
    entries = VALUES.calibration.entries
    assert [*found] == [f"state.calibration.{entry.name}" for entry in entries]
    factors = {
        each.Name.Value: each.COEFFS_LINEAR.A.Value if each.HasField("COEFFS_LINEAR") else 1.0
        for each in module.COMPU_METHOD
    }
    start = image.address("state.calibration")
    for place, entry in enumerate(entries):
        each = found[f"state.calibration.{entry.name}"]
        assert each.Address.Value == start + 4 * place
        factor = factors[each.Conversion.Value]
        assert factor == UNITS[entry.unit].factor
        assert each.LowerLimit.Value == float(f"{entry.least * factor:.7g}")
        assert each.UpperLimit.Value == float(f"{entry.most * factor:.7g}")
        assert (each.Deposit.Value, each.LongIdentifier.Value) == (
            "value_float32_ieee",
            entry.what,
        )
    measured = {each.Name.Value: each for each in module.MEASUREMENT}
    for name, each in measured.items():
        path = name.rsplit(".", 1)[0] if each.HasField("BIT_MASK") else name
        assert each.ECU_ADDRESS.Address.Value == image.place(path).address
        assert each.LowerLimit.Value < each.UpperLimit.Value
    for name in ("watch.good.soc", "watch.good.t_cl_degc", "watch.command_w", "cal.soc_min"):
        assert f"state.{name}" in measured
    for flag in Flag:
        assert measured[f"reply.out.flags.{flag.name.lower()}"].BIT_MASK.Mask.Value == flag
    assert {"reply.out.certificate_g", "reply.out.iterations", "in.soc"} <= {*measured}


def test_every_number_is_described() -> None:
    for name in ("mh-qp", "mh-costate"):
        calibration = Method.of(name, ControllerSettings()).values(load_vehicle(), None).calibration
        assert set(calibration.names) <= set(DESCRIBED)
        for entry in calibration.entries:
            assert entry.least <= entry.default <= entry.most
            assert entry.unit in UNITS


def test_a_tool_reads_and_writes_the_page_and_nothing_else(a2l, elf) -> None:
    address, _ = address_of(a2l, "soc_min")
    with Target(elf, VALUES, "f32", elf.parent, has_line=True) as target:
        target.init()
        master = XcpMaster(target.exchange)
        master.connect()
        assert master.read(address, 4) == struct.pack("<f", 0.4)
        master.write(address, struct.pack("<f", 0.45))
        assert master.read(address, 4) == struct.pack("<f", 0.45)
        short = struct.pack("<BBBBIf", 0xED, 4, 0, 0, address, 0.46)
        assert master.command(short) == b""
        assert master.read(address, 4) == struct.pack("<f", 0.46)
        with pytest.raises(XcpError, match="access denied"):
            master.write(address - 4, b"1234")  # before the page
        with pytest.raises(XcpError, match="access denied"):
            master.write(address + 4 * 27, b"12345678")  # beyond it
        with pytest.raises(XcpError, match="access denied"):
            master.read(0x0, 4)
        with pytest.raises(XcpError, match="access denied"):
            master.read(0xFFFFFFFE, 4)
        with pytest.raises(XcpError, match="command unknown"):
            master.command(b"\x11")
        with pytest.raises(XcpError, match="syntax"):
            master.command(b"\xf6")
        with pytest.raises(XcpError, match="out of range"):
            master.read(address, 200)
        master.disconnect()
        with pytest.raises(XcpError, match="no answer"):
            master.read(address, 4)  # without a connection


@pytest.fixture(scope="module")
def found(elf) -> CalibratedRun:
    whole = load_cycle("nycc")
    cut = Cycle.from_samples("start", whole.time_s[: SECONDS + 1], whole.speed_mps[: SECONDS + 1])
    changes = ["soc_min=0.9@60", "soc_min=0.4@70", "start_fuel_g=nan@70", "start_fuel_g=0.2@75"]
    changes += ["search_switch_g_per_s=0.02@80"]
    method = Method.of("mh-costate", ControllerSettings())
    parsed = [Change.parsed(text) for text in changes]
    return drive_calibrated(Trip(cut), parsed, method, VALUES, "f32", elf)


def test_a_number_written_while_a_cycle_runs_changes_the_trip(found) -> None:
    *_, last = found.changes
    assert (last.refused, last.before) == (False, pytest.approx(0.01))
    assert 80 <= last.differs_from <= 100
    before, after = (run.trajectory.p_eng_w for run in (found.plain, found.run))
    assert (before[: last.differs_from] == after[: last.differs_from]).all()  # the refused too


def test_a_wrong_number_is_refused_flagged_and_named(found, tmp_path) -> None:
    flagged = [k for k, flags in enumerate(found.flags) if flags & Flag.BAD_CALIBRATION]
    assert flagged == [*range(60, 75)]
    assert [change.refused for change in found.changes] == [True, True, True, False, False]
    assert [change.wrong_entry for change in found.changes[:3]] == [
        "soc_min",
        "start_fuel_g",
        "start_fuel_g",
    ]
    assert found.changes[0].differs_from is None
    assert "15 s flagged bad calibration" in calibrated_line(found)
    rows = calibrated_rows(found)
    assert rows[0][3:6] == ["40 %", "90 %", "refused, soc_min wrong"]
    write_calibrated(found, tmp_path)
    names = {file.name for file in tmp_path.iterdir()}
    assert names == {"controller.a2l", "as_it_is.csv", "calibrated.csv"}


def test_the_command_shows_what_became_of_each_change(found, tmp_path, monkeypatch) -> None:
    """The trips are those of the tests above: they are not driven again."""
    monkeypatch.setattr("qpmpc.codegen.pil.calibrated.calibrated_trip", lambda *_: found)
    command = ["pil", "nycc", "--controller", "mh-costate", "--calibrate", "soc_min=0.9@60"]
    done = CliRunner().invoke(app, [*command, "--json", str(tmp_path / "it.json")])
    assert done.exit_code == 0, done.output
    data = json.loads((tmp_path / "it.json").read_text())
    assert [change["refused"] for change in data["changes"]] == [True, True, True, False, False]
    assert {"as_it_is", "calibrated"} < {*data}
    for refused in (["--pareto"], ["--project", str(tmp_path / "board")]):
        other = ["pil", "nycc", "--calibrate", "soc_min=0.9@60", *refused]
        with pytest.raises(InputError, match="--calibrate"):
            app(other, standalone_mode=False)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("soc_min=0.5", "expected NAME=VALUE@SECOND"),
        ("soc_min@5", "expected NAME=VALUE@SECOND"),
        ("soc_min=0.5@-1", "must not be negative"),
        ("soc_mim=0.5@5", "soc_min"),
        ("soc_min=0.5@5000", "the trip ends after 598 s"),
    ],
)
def test_a_change_that_says_nothing_is_refused_in_one_line(text, message) -> None:
    with pytest.raises(InputError, match=message):
        calibrated_trip(Trip("nycc"), [Change.parsed(text)])


def test_an_image_without_a_controller_is_refused(tmp_path, elf) -> None:
    no_elf = tmp_path / "no.elf"
    no_elf.write_bytes(b"not one")
    with pytest.raises(InputError, match="no ELF file"):
        Image(no_elf)
    with pytest.raises(InputError, match="No such file"):
        Image(tmp_path / "missing.elf")
    with pytest.raises(InputError, match="no mpc_state left; there is state"):
        described(Image(elf), "left")
    with pytest.raises(InputError, match="ends with"):
        app(["a2l", str(tmp_path / "x.txt"), "--elf", str(elf)], standalone_mode=False)
