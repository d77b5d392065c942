"""The kinds of faults, each with what it needs."""

from typing import Literal, NamedTuple

SignalName = Literal["soc", "t_cl_degc", "demand_w", "speed_mps", "fuel_g", "engine_on", "second"]
KindName = Literal[
    "nan",
    "offset",
    "drift",
    "stuck",
    "jump",
    "delay",
    "missing",
    "stale",
    "wild",
    "too-short",
    "too-long",
    "solver-failure",
    "missed-second",
    "repeated-second",
    "reset",
    "late",
]
MEASURED: tuple[SignalName, ...] = ("soc", "t_cl_degc", "demand_w", "speed_mps")
SENSED: tuple[SignalName, ...] = (*MEASURED, "fuel_g")  # the last by some controllers only
SIGNALS: tuple[SignalName, ...] = (*SENSED, "engine_on", "second")


class Kind(NamedTuple):
    """What a kind of fault does.

    Attributes
    ----------
    text : what happens in each of its seconds
    signals : that it can be a fault of; empty if it is none of a signal
    value : what its value is, empty if it has none; in the unit of the signal if not said
    whole : whether the value is a number of whole seconds, 1 or more
    """

    text: str
    signals: tuple[SignalName, ...] = ()
    value: str = ""
    whole: bool = False


KINDS: dict[KindName, Kind] = {
    "nan": Kind("the signal is not a number", SENSED),
    "offset": Kind("the signal is wrong by `value`", (*SENSED, "second"), "error"),
    "drift": Kind("the error grows by `value` every second", SENSED, "error per second"),
    "stuck": Kind("the signal stays at what it was in the second `at_s`", SIGNALS),
    "jump": Kind("the signal is `value`", SIGNALS, "what is seen instead"),
    "delay": Kind(
        "the signal is that of `value` seconds before", (*SENSED, "engine_on"), "seconds", True
    ),
    "missing": Kind("no preview arrives"),
    "stale": Kind("the preview of the second `at_s` arrives again"),
    "wild": Kind("the preview is random, within ±1 MW and 300 m/s"),
    "too-short": Kind("the trip seems to end `value` seconds early", (), "seconds", True),
    "too-long": Kind("the trip seems to end `value` seconds late", (), "seconds", True),
    "solver-failure": Kind("the solver finds no usable solution"),
    "missed-second": Kind("the controller is not called; its last command stays"),
    "repeated-second": Kind("the controller is called twice; its second command counts"),
    "reset": Kind("the ECU starts again before the second and has forgotten everything"),
    "late": Kind(
        "the engine gets the command of `value` seconds before: a solver that is late",
        (),
        "seconds",
        True,
    ),
}
OF_PREVIEW: tuple[KindName, ...] = ("missing", "stale", "wild", "too-short", "too-long")
