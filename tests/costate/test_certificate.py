"""The bound against exact solutions of small programs: never above, near, and its signs matter."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from small_program import exact, program

from qpmpc.costate.certificate import choose
from qpmpc.costate.dual import Multipliers, StageCosts, constant_part, dual, with_signs
from qpmpc.costate.solve import newton

MOST = 3e3  # g per unit of SOC
NEAR_G = 0.8
CASES = [  # vehicle, second, SOC, coolant, engine on; the last ones arrive within the horizon
    ("prius-nimh", 0, 0.6, 52.0, False),
    ("prius-nimh", 10, 0.598, 50.05, True),
    ("prius-liion", 5, 0.599, 60.0, False),
    ("paper-liion", 20, 0.602, 55.0, True),
    ("prius-liion", 56, 0.6, 52.0, False),
]


@pytest.fixture(scope="module", params=CASES, ids=str)
def case(request):
    made, layout = program(*request.param)
    return made, layout, *solved(request.param)


@cache
def solved(of):
    cost, least = exact(*program(*of))
    assert np.isfinite(cost)
    return cost, least


def bound(p, layout, at):
    costs = StageCosts.of(p, at, p.shared).with_first(layout.short, StageCosts.of(p, at, p.curves))
    return choose(p, at, costs, layout).bound_g


def found(p):
    n = len(p.duration_s)
    return newton(p, Multipliers(np.full(n, 150.0), np.zeros(n)), 40, MOST).at


def anywhere(p, seed):
    """Multipliers of the right sign, but of no merit."""
    rng = np.random.default_rng(seed)
    n = len(p.duration_s)
    at = found(p)
    charge = at.charge * rng.uniform(0.5, 1.5) * np.where(rng.random(n) < 0.3, rng.random(n), 1.0)
    heat = at.heat + rng.normal(0.0, 0.2, n) * (rng.random(n) < 0.5)
    return with_signs(Multipliers(charge, heat), p.slack_g_per_k)


def test_never_above_the_exact_solution(case):
    p, layout, cost, _ = case
    assert bound(p, layout, found(p)) <= cost + 1e-6
    for seed in range(15):
        assert bound(p, layout, anywhere(p, seed)) <= cost + 1e-6
        assert dual(p, anywhere(p, seed)).value <= cost + 1e-6


def test_never_above_where_a_block_pays_for_being_entered():
    """As in the QP."""
    p, layout = program("prius-liion", 5, 0.599, 60.0, False)
    rises = p.rises.copy()
    rises[layout.short] = 1.0
    coupled = replace(p, rises=rises)
    cost, _ = exact(coupled, layout)
    for seed in range(15):
        assert bound(coupled, layout, anywhere(coupled, seed)) <= cost + 1e-6


def test_near_the_exact_solution(case):
    """What is left is the duality gap of on or off: in the best plan of eight stages, three of
    them long and wholly on or off, up to 0.7 g; a plan of a hundred stages can do better."""
    p, layout, cost, _ = case
    assert bound(p, layout, found(p)) >= cost - NEAR_G


def broken(p, layout):
    """The bound with one of its signs or terms wrong, at the best multipliers."""
    at = found(p)
    costs = StageCosts.of(p, at, p.shared)
    right = bound(p, layout, at)
    constant = constant_part(p, at, costs.nu)

    def with_constant(other, nu):
        return right - constant + constant_part(other, at, nu)

    yield "SOC limits swapped", with_constant(replace(p, soc_low=p.soc_high + 0.2), costs.nu)
    yield "SOC now with the wrong sign", right + 2.0 * float(at.charge[0]) * p.soc
    yield "coolant now left out", with_constant(replace(p, t_cl_degc=0.0), costs.nu)
    yield "nu not from its recursion", with_constant(p, costs.nu + 0.05)
    yield "lambda negative", bound(p, layout, Multipliers(-at.charge, at.heat))


def test_a_wrong_sign_is_noticed():
    """By the two tests above, on one of the programs at least."""
    noticed: dict[str, bool] = {}
    for each in CASES[:3]:
        p, layout = program(*each)
        cost, _ = solved(each)
        for name, value in broken(p, layout):
            wrong = value > cost + 1e-6 or value < cost - NEAR_G
            noticed[name] = noticed.get(name, False) or wrong
    assert all(noticed.values()), noticed
