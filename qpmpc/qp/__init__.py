"""The multi-horizon QP: structure once, values each step."""

from qpmpc.qp.scaling import Scaling, ScalingSettings
from qpmpc.qp.stage_qp import Linearisation, QpData, QpSettings, StageQp
from qpmpc.qp.structure import VARS, QpStructure, Rows, Var

__all__ = [
    "VARS",
    "Linearisation",
    "QpData",
    "QpSettings",
    "QpStructure",
    "Rows",
    "Scaling",
    "ScalingSettings",
    "StageQp",
    "Var",
]
