"""The plant's trajectory under the policy of one grid."""

from dataclasses import dataclass

from qpmpc.verification.dynamic_programming.kernels import Bools, Floats


@dataclass(frozen=True)
class Trajectory:
    """States, commands, fuel and costates; arrays as in `DpSolution`.

    `value_g` is the value function at the start, `admissible` whether every limit could be kept.
    """

    soc: Floats
    t_cl_degc: Floats
    engine_on: Bools
    p_eng_w: Floats
    fuel_g: Floats
    soc_costate_g: Floats
    t_cl_costate_g_per_k: Floats
    value_g: float
    admissible: bool
