"""Weights and margins of the plan's program."""

from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator


class LimitSettings(BaseModel):
    """Terminal band and margins of the plan's limits.

    Attributes
    ----------
    terminal_low, terminal_high : terminal SOC band as multiples of the SOC at arrival
        that the trip asks for (paper eq. 11); of no effect with `trip.soc_end_at_least`
    soc_reserve : share of the room between the lower SOC limit and the lower one of the SOC at
        departure and that at arrival that is planned
        to be left at the end of a block in which the thermostat opens, half of it where not: if the
        coolant limits the engine more than the plan knows, the battery has to give the rest
    t_cl_margin_k : the coolant is planned to stay this far above its lower limit, beside the
        reserve of `heat_reserve_k`
    slack_g_per_k : price of exceeding a coolant limit, g per K and stage
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    terminal_low: Annotated[float, Field(gt=0.0, le=1.5)] = 1.0
    terminal_high: Annotated[float, Field(gt=0.0, le=1.5)] = 1.01
    soc_reserve: Annotated[float, Field(ge=0.0, le=0.9)] = 0.42
    t_cl_margin_k: Annotated[float, Field(ge=0.0, le=10.0)] = 0.3
    slack_g_per_k: Annotated[float, Field(ge=1e-6, le=1e6)] = 10.0

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.terminal_low > self.terminal_high:
            raise ValueError("terminal_low must not be above terminal_high")
        return self


class QpSettings(LimitSettings):
    """Weights and margins of the QP.

    Beside those of `LimitSettings`:

    Attributes
    ----------
    soc_penalty_g : lambda of a quadratic terminal cost, g per (unit SOC)^2, instead of the band
    regularisation : quadratic cost on rates and slack in solver units, far below any fuel
    """

    soc_penalty_g: Annotated[float, Field(ge=0.0, le=1e9)] = 0.0
    regularisation: Annotated[float, Field(ge=0.0, le=1.0)] = 1e-5
