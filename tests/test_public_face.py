"""The public face: complete, typed, documented, quick to import."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import qpmpc

FACE = Path(qpmpc.__file__)
HEAVY = ("numpy", "scipy", "osqp", "cvxpy", "qpsolvers", "matplotlib", "casadi", "numba")


def test_every_name_is_there() -> None:
    for name in qpmpc.__all__:
        assert getattr(qpmpc, name).__name__ == name
    assert set(qpmpc.__all__) <= set(dir(qpmpc))


def test_type_checkers_see_the_same_names() -> None:
    tree = ast.parse(FACE.read_text("utf-8"))
    block = next(
        node
        for node in tree.body
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    )
    seen = {
        alias.asname: f"{node.module}"
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert seen == {name: f"qpmpc.{home}" for name, home in qpmpc._HOME.items()}


def test_a_wrong_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="nonsense"):
        qpmpc.nonsense  # noqa: B018


@pytest.mark.parametrize("name", qpmpc.__all__)
def test_every_name_is_documented(name: str) -> None:
    assert (getattr(qpmpc, name).__doc__ or "").strip()


@pytest.mark.parametrize(
    ("statement", "absent"),
    [
        ("import qpmpc", HEAVY),
        # own controllers and planners need numpy and pydantic, but no solver and no plotting
        ("import qpmpc; qpmpc.Controller, qpmpc.Planner, qpmpc.Trip", HEAVY[3:]),
        ("import qpmpc; qpmpc.simulate, qpmpc.compare", HEAVY[3:]),
    ],
)
def test_importing_is_light(statement: str, absent: tuple[str, ...]) -> None:
    code = f"{statement}; import sys; print([m for m in {absent} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
