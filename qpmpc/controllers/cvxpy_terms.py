"""What a user adds to the cvxpy program, checked: errors in the words of the one who wrote it."""

from collections.abc import Callable
from typing import Any

import cvxpy

from qpmpc.errors import QpmpcError
from qpmpc.qp.cvxpy_twin import CvxpyTwin
from qpmpc.qp.quantities import STAGE

cp: Any = cvxpy  # its type hints leave out half of its functions

UNKNOWN: str = cp.settings.UNKNOWN  # of a sign, of a curvature
SHOWN = 100  # characters of an expression in a message


def checked_terms(
    name: str, program: CvxpyTwin, terms: Callable[[CvxpyTwin], Any]
) -> tuple[Any, list[Any]]:
    """Return the cost and the constraints that `terms` adds.

    Parameters
    ----------
    name : of the planner, for messages
    program : that they are added to
    terms : of the planner

    Raises
    ------
    QpmpcError
        If they have another form or shape, or are not convex or not DPP by cvxpy's rules.
    """
    try:
        added = terms(program)
    except (ValueError, AttributeError, cp.DCPError) as error:
        said = " ".join(str(error).split())
        raise QpmpcError(
            f"{name}: terms: {said} (expressions of the program have shape ({program.stages},), "
            "one entry per stage)"
        ) from error
    if not (isinstance(added, tuple) and len(added) == 2):
        raise QpmpcError(f"{name}: terms returned {added!r}, not (cost, [constraints])")
    cost, constraints = _checked_cost(name, added[0]), added[1]
    if not isinstance(constraints, list | tuple):
        raise QpmpcError(f"{name}: terms: the constraints are {constraints!r}, not a list")
    for i, each in enumerate(constraints, 1):
        if not isinstance(each, cp.Constraint):
            raise QpmpcError(
                f"{name}: terms: constraint {i} is {_short(each)}, not a cvxpy constraint such as "
                "program.soc >= 0.5"
            )
        if not each.is_dcp():
            raise QpmpcError(
                f"{name}: terms: constraint {i} is not convex by cvxpy's rules: {_short(each)}; "
                "allowed are convex <= concave, and affine == affine"
            )
        if not each.is_dcp(dpp=True):
            raise QpmpcError(f"{name}: terms: constraint {i} {NOT_DPP}: {_short(each)}")
    return cost, list(constraints)


NOT_DPP = (
    "is no parametrised program (DPP): a parameter may be multiplied by a variable, not by another "
    "parameter"
)


def _checked_cost(name: str, cost: Any) -> Any:
    """Return the cost as an expression that cvxpy can minimise."""
    try:
        grams = cp.Expression.cast_to_const(cost)
    except (ValueError, TypeError) as error:
        raise QpmpcError(f"{name}: terms: the cost is {_short(cost)}, not an expression") from error
    if grams.size != 1:
        raise QpmpcError(
            f"{name}: terms: the cost has shape {grams.shape}, and must be one number in grams: "
            "sum it over the stages with cp.sum"
        )
    if not grams.is_convex():
        raise QpmpcError(
            f"{name}: terms: the cost is not convex by cvxpy's rules but "
            f"{grams.curvature.lower()}: {_short(cost)}{_why_unknown(grams)}"
        )
    if not grams.is_dpp():
        raise QpmpcError(f"{name}: terms: the cost {NOT_DPP}: {_short(cost)}")
    return grams


def _why_unknown(expression: Any) -> str:
    """Return a usual reason for a curvature that cvxpy cannot tell: a weight of unknown sign."""
    signless = {each.name() for each in expression.parameters() if each.sign == UNKNOWN}
    if not signless or expression.curvature != UNKNOWN:
        return ""
    of_road = sorted(signless.intersection(STAGE))
    own = sorted(signless.difference(STAGE))
    said = [f"{', '.join(of_road)} may be negative, and so weigh nothing convex"] if of_road else []
    if own:
        said.append(
            f"if {', '.join(own)} weighs something convex, cvxpy has to know its sign: "
            "cp.Parameter(nonneg=True)"
        )
    return "".join(f"; {each}" for each in said)


def _short(what: Any) -> str:
    text = " ".join(str(what).split())
    return text if len(text) <= SHOWN else text[: SHOWN - 3] + "..."
