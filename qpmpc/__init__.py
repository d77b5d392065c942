"""Multi-horizon MPC, posed as a QP, for the power and thermal management of hybrid cars."""

from qpmpc._clash import refuse_other_qpmpc

__version__ = "0.1.0"

refuse_other_qpmpc()
