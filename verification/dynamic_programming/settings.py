"""How finely dynamic programming resolves state and input."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Step = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


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

    soc_step: Annotated[Step, Field(le=0.1)] = 0.002
    t_cl_step_k: Annotated[Step, Field(le=10.0)] = 0.5
    power_step_w: Annotated[Step, Field(le=10000.0)] = 500.0
    refinement: Annotated[int, Field(ge=1, le=256)] = 8
    tube_soc: Annotated[Step, Field(le=1.0)] = 0.04
    tube_t_cl_k: Annotated[Step, Field(le=100.0)] = 5.0
    threads: Annotated[int, Field(ge=1)] | None = None

    @classmethod
    def quick(cls) -> "DpSettings":
        """Coarser grids for quick use; see docs/dynamic_programming.md for their error."""
        return cls(soc_step=0.004, t_cl_step_k=1.0, power_step_w=1000.0, refinement=4)

    def doubled(self) -> "DpSettings":
        """Halve every spacing of the tube: cells in SOC and T, and the engine power."""
        return self.model_copy(
            update={"refinement": 2 * self.refinement, "power_step_w": 0.5 * self.power_step_w}
        )
