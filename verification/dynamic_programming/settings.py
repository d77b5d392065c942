"""How finely dynamic programming resolves state and input."""

from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

CELLS_MAX = 4e6
"""Of one grid: some gigabytes, as its values at some tens of seconds are kept."""

T_CL_RANGE_K = 100.0


class DpSettings(BaseModel):
    """Grid of the state and the input; the defaults are the reference, `quick` takes seconds.

    Two levels are solved: the whole box of limits on a coarse grid, then a tube around the
    coarse trajectory whose cells are `refinement` times smaller in SOC and in T. The tube moves
    and widens until the optimal trajectory stays clear of its edges.

    Attributes
    ----------
    soc_step, t_cl_step_k : cells of the coarse grid, 1 and K
    power_step_w : spacing of the engine power in the backward pass; the forward pass refines it
    refinement : cells of the tube in one coarse cell, along each axis
    tube_soc, tube_t_cl_k : half widths of the tube at first, 1 and K
    threads : processor cores to use, all that are allowed if None; does not change the result
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    soc_step: Annotated[float, Field(ge=1e-4, le=0.1)] = 0.002
    t_cl_step_k: Annotated[float, Field(ge=0.01, le=10.0)] = 0.5
    power_step_w: Annotated[float, Field(ge=10.0, le=10e3)] = 500.0
    refinement: Annotated[int, Field(ge=1, le=256)] = 8
    tube_soc: Annotated[float, Field(ge=1e-3, le=1.0)] = 0.04
    tube_t_cl_k: Annotated[float, Field(ge=0.1, le=100.0)] = 5.0
    threads: Annotated[int, Field(ge=1, le=1024)] | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        box = T_CL_RANGE_K / (self.soc_step * self.t_cl_step_k)
        cell = self.soc_step * self.t_cl_step_k / self.refinement**2
        tube = 4.0 * self.tube_soc * self.tube_t_cl_k / cell
        for cells, keys in ((box, "soc_step, t_cl_step_k"), (tube, "tube_soc, tube_t_cl_k")):
            if cells > CELLS_MAX:
                raise ValueError(f"{keys} make {cells:.2g} cells, at most {CELLS_MAX:.2g}")
        return self

    @classmethod
    def quick(cls) -> "DpSettings":
        """Coarser grids for quick use; see docs/dynamic_programming.md for their error."""
        return cls(soc_step=0.004, t_cl_step_k=1.0, power_step_w=1000.0, refinement=4)

    def doubled(self) -> "DpSettings":
        """Halve every spacing of the tube: cells in SOC and T, and the engine power."""
        return self.model_copy(
            update={"refinement": 2 * self.refinement, "power_step_w": 0.5 * self.power_step_w}
        )
