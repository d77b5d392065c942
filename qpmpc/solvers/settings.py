"""Settings of ADMM, separate from the solver itself, which takes time to load."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field


class AdmmSettings(BaseModel):
    """Settings of ADMM, OSQP's algorithm. Every step does the same arithmetic.

    Attributes
    ----------
    iterations : K, iterations per step
    cold_iterations : iterations of a solve without warm start, at departure
    rho, proximal_weight, relaxation : step size, weight of the proximal term (sigma in OSQP's
        paper) and over-relaxation
    status_tolerance : on the residuals, absolute and relative, for OSQP's result to count as
        solved; a result that does not is used all the same
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    iterations: Annotated[int, Field(ge=1, le=100_000)] = 50
    cold_iterations: Annotated[int, Field(ge=1, le=1_000_000)] = 4000
    rho: Annotated[float, Field(ge=1e-6, le=1e6)] = 0.1  # as OSQP has it
    proximal_weight: Annotated[float, Field(ge=1e-20, le=1e3)] = 1e-6
    relaxation: Annotated[float, Field(ge=0.01, le=1.99)] = 1.6
    status_tolerance: Annotated[float, Field(ge=1e-12, lt=1.0)] = 1e-3
