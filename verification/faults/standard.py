"""The standard faults: every kind of every signal, small and plausible ones beside absurd ones."""

from typing import Any, NamedTuple

from qpmpc.faults.kinds import MEASURED

DURATIONS_S = (3, 10)
STARTS_S = (60, 150, 200, 278, 420, 545)  # with the engine on, off, about to start


class Sizes(NamedTuple):
    """Sizes of the faults of one signal, in its unit."""

    small: float
    large: float
    per_s: float
    absurd: float


SIZES = {
    "soc": Sizes(0.002, 0.05, 0.001, 0.95),
    "t_cl_degc": Sizes(0.5, 20.0, 0.2, 110.0),
    "demand_w": Sizes(1e3, 3e4, 500.0, 1e6),
    "speed_mps": Sizes(1.0, 20.0, 0.5, 300.0),
}


def standard_faults() -> list[dict[str, Any]]:
    """Return the faults without their time, as `qpmpc.faults.models.Fault` takes them."""
    faults: list[dict[str, Any]] = []
    for signal in MEASURED:
        small, large, per_s, absurd = SIZES[signal]
        faults += [
            {"kind": "nan", "signal": signal},
            *({"kind": "offset", "signal": signal, "value": x} for x in (small, -small, large)),
            {"kind": "drift", "signal": signal, "value": per_s},
            {"kind": "stuck", "signal": signal},
            {"kind": "jump", "signal": signal, "value": absurd},
            {"kind": "delay", "signal": signal, "value": 2.0},
        ]
    return [
        *faults,
        {"kind": "stuck", "signal": "engine_on"},
        {"kind": "jump", "signal": "engine_on", "value": 0.0},
        {"kind": "jump", "signal": "engine_on", "value": 1.0},
        {"kind": "delay", "signal": "engine_on", "value": 2.0},
        {"kind": "stuck", "signal": "second"},
        {"kind": "offset", "signal": "second", "value": 5.0},
        {"kind": "offset", "signal": "second", "value": -5.0},
        {"kind": "jump", "signal": "second", "value": 1e6},
        {"kind": "missing"},
        {"kind": "stale"},
        {"kind": "wild"},
        {"kind": "too-short", "value": 30.0},
        {"kind": "too-short", "value": 1000.0},
        {"kind": "too-long", "value": 30.0},
        {"kind": "too-long", "value": 1000.0},
        {"kind": "solver-failure"},
        {"kind": "missed-second"},
        {"kind": "repeated-second"},
        {"kind": "reset"},
        {"kind": "late", "value": 1.0},
        {"kind": "late", "value": 2.0},
    ]
