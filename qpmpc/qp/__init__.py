"""The multi-horizon QP: structure once, values each step; and its twin in cvxpy."""

from typing import TYPE_CHECKING, Any

from qpmpc.qp.linearisation import Linearisation
from qpmpc.qp.rows import Rows, Table, Var, table_of
from qpmpc.qp.scaling import Scaling, ScalingSettings
from qpmpc.qp.settings import QpSettings
from qpmpc.qp.stage_qp import QpData, StageQp
from qpmpc.qp.structure import QpStructure

if TYPE_CHECKING:
    from qpmpc.qp.cvxpy_twin import CvxpyTwin

__all__ = [
    "CvxpyTwin",
    "Linearisation",
    "QpData",
    "QpSettings",
    "QpStructure",
    "Rows",
    "Scaling",
    "ScalingSettings",
    "StageQp",
    "Table",
    "Var",
    "table_of",
]


def __getattr__(name: str) -> Any:
    """Import the twin on first use: cvxpy takes a second to load."""
    if name == "CvxpyTwin":
        from qpmpc.qp.cvxpy_twin import CvxpyTwin

        return CvxpyTwin
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
