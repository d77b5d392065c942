"""Under every standard fault, C and Python drive by the same rung, with the same flags."""

import pytest

from qpmpc.closed_loop import drive
from qpmpc.codegen.c_compiler import compiler
from qpmpc.controllers.monitor import Flag
from qpmpc.faults.models import as_faults
from qpmpc.registry import make_controller, split_settings
from qpmpc.trajectory import Trajectory
from qpmpc.trip import Trip
from qpmpc.verification.faults.standard import standard_faults

pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler")
FIRST_S, APART_S = 20, 28  # far enough for the ladder to be back at the plan
GROUPS = [standard_faults()[k::3] for k in range(3)]


def driven(implementation: str, faults: list[dict]) -> Trajectory:
    trip = Trip("nycc")
    settings = split_settings({"mh_qp.implementation": implementation})[1]
    return drive(
        trip, make_controller("mh-qp", trip, settings), faults=as_faults(faults)
    ).trajectory


@pytest.mark.slow
@pytest.mark.parametrize("for_s", [3, 10])
@pytest.mark.parametrize("faults", GROUPS, ids=["first", "second", "third"])
def test_c_and_python_agree_each_second(faults, for_s):
    timed = [
        {**fault, "at_s": FIRST_S + k * APART_S, "for_s": for_s} for k, fault in enumerate(faults)
    ]
    assert timed[-1]["at_s"] + for_s < 598
    in_c, in_python = (driven(language, timed) for language in ("c", "python"))
    differ = [
        (t, one, other)
        for t, (one, other) in enumerate(
            zip(
                zip(in_c.fallback, in_c.flags.tolist(), strict=True),
                zip(in_python.fallback, in_python.flags.tolist(), strict=True),
                strict=True,
            )
        )
        if one != other
    ]
    assert not differ, [
        (t, next((f for f in reversed(timed) if f["at_s"] <= t), None), one, other)
        for t, one, other in differ[:5]
    ]
    assert in_c.p_eng_w == pytest.approx(in_python.p_eng_w, abs=1.0)
    assert in_c.flags.any()  # else nothing would be tested
    assert not in_c.flags[: FIRST_S - 1].any()


def test_flags_of_solver_and_preview_come_from_the_injected_seconds():
    faults = [
        {"kind": "solver-failure", "at_s": 100, "for_s": 2},
        {"kind": "wild", "at_s": 150, "for_s": 2},
    ]
    flags = driven("c", faults).flags
    assert flags.nonzero()[0].tolist() == [100, 101, 150, 151]
    assert flags[100] == Flag.SOLVER_FAILED
    assert flags[150] == Flag.BAD_PREVIEW
