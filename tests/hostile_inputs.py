"""Hostile inputs for loaders of users' files: good ones with anything done to them."""

import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256
from importlib import resources
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from asammdf import MDF, Signal
from board_log import bodies, line, text_of
from hypothesis import strategies as st

from qpmpc.codegen.board.log import read_log
from qpmpc.codegen.board.manifest import Manifest, load_manifest, load_sources
from qpmpc.cycles import load_cycle
from qpmpc.faults.models import load_faults
from qpmpc.registry import split_settings
from qpmpc.settings import parse_settings
from qpmpc.vehicle import load_vehicle
from qpmpc.vehicle.from_map import vehicle_from_map

ODD_NUMBERS = [
    "0", "-0.0", "1", "-1", "1e-308", "1e308", "1e999", "-1e999", "nan", "inf", "-inf",
    "+1", "0x10", "1_000", ".5", "1.", "1e5", "0.6", "85", "70000",
]  # fmt: skip
NUMBERS = st.floats().map(repr) | st.sampled_from(ODD_NUMBERS)
ODD_VALUES = [
    "true", "false", "''", '"x"', "[]", "{}", "[[1]]", "[1, true]", "{a = 1}", "1979-05-27",
    "[0, 1]", "[1000, 5200]", '"""a\\u0000b"""', "", "=", "#", "'\''",
    "9" * 5000, "0x" + "f" * 2000, "[" * 2000, "{a=" * 500, '"' + "y" * 5000 + '"',
    "[" + "0.5, " * 3000 + "1]",
]  # fmt: skip
ODD_PIECES = [
    "\n", "\r", "\0", '"', "'", ",", ";", ".", "=", "[", "]", "[[", "\ufeff", "\x85", "\u2028",
    "e", "é", "-", "km/h", "a." * 40, ",," * 50, "[x]\n", "base = 'prius-liion'\n", "#",
]  # fmt: skip
VALUES = (
    NUMBERS
    | st.integers().map(str)
    | st.sampled_from(ODD_VALUES)
    | st.lists(NUMBERS, max_size=15).map(lambda numbers: f"[{', '.join(numbers)}]")
)
PIECES = st.sampled_from(ODD_PIECES) | st.text(max_size=10)
NUMBER = re.compile(r"\d+(\.\d*)?")
EDITS = ["scale", "scale", "value", "value", "drop", "twice", "insert", "swap"]


@st.composite
def edited(draw: st.DrawFn, good: str, separators: str) -> bytes:
    """A good text with some edits: values changed, lines and characters moved, bytes cut."""
    lines = good.splitlines(keepends=True)
    for _ in range(draw(st.sampled_from([0, 1, 1, 1, 2, 3]))):
        at = draw(st.integers(0, len(lines) - 1))
        kind = draw(st.sampled_from(EDITS))
        if kind == "scale":
            factor = draw(st.floats(0.5, 2.0) | st.sampled_from([-1.0, 0.0, 0.1, 10.0, 3.6]))
            lines[at] = NUMBER.sub(lambda n, f=factor: f"{float(n[0]) * f:.6g}", lines[at])
        elif kind == "value":
            start = max(lines[at].find(separator) for separator in separators)
            lines[at] = f"{lines[at][: start + 1]} {draw(VALUES)}\n"
        elif kind == "drop" and len(lines) > 1:
            del lines[at]
        elif kind == "twice":
            lines.insert(at, lines[at])
        elif kind == "insert":
            place = draw(st.integers(0, len(lines[at])))
            lines[at] = lines[at][:place] + draw(PIECES) + lines[at][place:]
        else:
            other = draw(st.integers(0, len(lines) - 1))
            lines[at], lines[other] = lines[other], lines[at]
    content = "".join(lines).encode("utf-8", "surrogatepass")
    for _ in range(draw(st.sampled_from([0, 0, 0, 0, 0, 0, 1, 2]))):
        start, length = draw(st.integers(0, len(content))), draw(st.integers(0, 50))
        content = content[:start] + draw(st.binary(max_size=8)) + content[start + length :]
    return content


def _shipped(name: str) -> str:
    return (resources.files("qpmpc.vehicle") / "data" / f"{name}.toml").read_text("utf-8")


CYCLE = "time_s,speed_mps,grade\n" + "".join(
    f"{k},{min(k, 40 - k, 12)},{0.01 if k > 20 else 0}\n" for k in range(41)
)
LOG = "Logger X\nTime;Vehicle Speed [km/h];Grade;RPM\ns;km/h;%;1/min\n" + "".join(
    f"{k},0;{3 * min(k, 40 - k, 12)},5;{1 if k > 20 else 0};{800 + k}\n" for k in range(41)
)
GPX = """<?xml version="1.0" encoding="UTF-8"?>
<gpx version="1.1" creator="x" xmlns="http://www.topografix.com/GPX/1/1">
<trk><trkseg>
""" + "".join(
    f'<trkpt lat="{50 + k / 1e4:.5f}" lon="7.0"><ele>{100 + k}</ele>\n'
    f"<time>2026-01-01T00:00:{k:02}Z</time>\n"
    f"<extensions><speed>{11.1}</speed></extensions></trkpt>\n"
    for k in range(40)
) + "</trkseg></trk></gpx>\n"  # fmt: skip
ENGINE = "Speed [rpm],Torque [Nm],BSFC [g/kWh]\n" + "".join(
    f"{n},{t},{220 + 3000 / t + n / 100}\n" for n in (1000, 2000, 3000) for t in (10, 40, 80, 110)
)
FAULTS = """[[fault]]
kind = "offset"
signal = "soc"
at_s = 100
for_s = 3
value = 0.05

[[fault]]
kind = "solver-failure"
at_s = 200
"""
MANIFEST = Manifest(
    version="0.1.0",
    target="linux",
    controller="mh-qp",
    algorithm="admm",
    precision="f32",
    iterations=30,
    cycle="nycc",
    vehicle="prius-nimh",
    prepared=True,
    power_max_w=57e3,
    trip_s=598,
    seconds=60,
    files={"mpc.h": sha256(b"").hexdigest()},
)
WITH_BASE = "name = 'mine'\nbase = 'prius-nimh'\n[battery]\nsoc_min = 0.45\naux_power_w = 500\n"
VEHICLE = load_vehicle()
OWN_VALUES = {  # which are good
    f"{section}.{key}": json.dumps(value)
    for section, values in VEHICLE.model_dump(exclude={"name", "description"}).items()
    for key, value in values.items()
}
KEYS = [
    *OWN_VALUES,
    "mh_qp.admm.rho", "mh_qp.admm.iterations", "mh_qp.horizon.blocks", "mh_qp.qp.terminal_high",
    "mh_qp.solver", "mh_qp.osqp.rho", "rule_based.on_w", "ecms.factor_min", "dp.soc_step",
    "baseline_mpc.horizon_s", "mh_qp", "name", "others.x", "mh_qp_paper.pwa.alpha",
]  # fmt: skip


GOOD_VALUES = ["0.5", "0.6", "1", "1.01", "20", "60", "85", "3000", "20000.0", "70000", "1e6"]


@st.composite
def settings_texts(draw: st.DrawFn) -> list[str]:
    """Arguments of ``--set``, some of them bytes that are no text, as a shell passes them."""
    texts = []
    for _ in range(draw(st.integers(1, 3))):
        key, value = draw(st.sampled_from(KEYS)), draw(st.sampled_from(GOOD_VALUES))
        what = draw(st.sampled_from(["own", "own", "good", "key", "value", "value", "text"]))
        if what == "own":
            value = OWN_VALUES.get(key, value)
        if what == "key":
            key = draw(PIECES | PIECES.map(lambda piece, key=key: key + piece))
        elif what == "value":
            value = draw(VALUES | PIECES | st.binary(max_size=6).map(os_text))
        texts.append(key + value if what == "text" else f"{key}={value}")
    return texts


def os_text(content: bytes) -> str:
    """An argument's bytes as Python has them: no text is escaped into surrogates."""
    return content.decode("utf-8", "surrogateescape")


def _measurement() -> bytes:
    """A small MDF 4 with speed and elevation."""
    time = np.arange(41.0)
    channels = [
        Signal(3.6 * np.clip(np.minimum(time, 40 - time), 0, 12), time, name="Speed", unit="km/h"),
        Signal(100 + time, time, name="Altitude", unit="m"),
    ]
    with TemporaryDirectory() as folder, MDF() as file:
        file.append(channels)
        return file.save(Path(folder) / "a.mf4").read_bytes()


@st.composite
def changed_bytes(draw: st.DrawFn, good: bytes) -> bytes:
    """A good file with some bytes of other values, or cut."""
    content = bytearray(good)
    for _ in range(draw(st.integers(0, 4))):
        content[draw(st.integers(0, len(good) - 1))] = draw(st.integers(0, 255))
    return bytes(content[: draw(st.just(len(good)) | st.integers(0, len(good)))])


@st.composite
def board_logs(draw: st.DrawFn) -> bytes:
    """A board's log with something done to its lines, before or after their checksums."""
    content: bytes = draw(edited("\n".join(bodies()), ","))
    if draw(st.booleans()):
        return draw(edited(text_of(bodies()), ","))
    return "".join(line(body) for body in content.decode("latin-1").split("\n")).encode("latin-1")


def _load_settings(_: Path, texts: list[str]) -> None:
    of_vehicle, _settings = split_settings(parse_settings(texts))
    VEHICLE.with_settings(of_vehicle)


def _load_map(path: Path) -> None:
    vehicle_from_map(path, "prius-nimh", "mine")


def _file(name: str, load: Callable[[Path], object]) -> Callable[[Path, bytes], None]:
    def loader(folder: Path, content: bytes) -> None:
        path = folder / name
        path.write_bytes(content)
        (folder / "mpc.h").touch()  # the source of a board's project
        load(path)

    return loader


@dataclass(frozen=True)
class Loader:
    """A loader of users' inputs: what it is given, and how."""

    inputs: st.SearchStrategy[object]
    load: Callable[[Path, object], object]


# A further loader is one more entry.
LOADERS: dict[str, Loader] = {
    "cycle": Loader(edited(CYCLE, ",") | st.binary(max_size=200), _file("trip.csv", load_cycle)),
    "vehicle": Loader(
        edited(_shipped("prius-nimh"), "=") | edited(WITH_BASE, "=") | st.binary(max_size=200),
        _file("car.toml", load_vehicle),
    ),
    "faults": Loader(
        edited(FAULTS, "=") | st.binary(max_size=200), _file("faults.toml", load_faults)
    ),
    "settings": Loader(settings_texts(), _load_settings),
    "log": Loader(edited(LOG, ";") | st.binary(max_size=200), _file("log.csv", load_cycle)),
    "gpx": Loader(edited(GPX, ">") | st.binary(max_size=200), _file("trip.gpx", load_cycle)),
    "mdf": Loader(
        changed_bytes(_measurement()) | st.binary(max_size=200), _file("trip.mf4", load_cycle)
    ),
    "board log": Loader(board_logs() | st.binary(max_size=200), _file("board.log", read_log)),
    "board project": Loader(
        edited(MANIFEST.text(), "=") | st.binary(max_size=200),
        _file("replay.toml", lambda path: load_sources(path.parent, load_manifest(path.parent))),
    ),
    "engine": Loader(edited(ENGINE, ",") | st.binary(max_size=200), _file("map.csv", _load_map)),
}
