"""How finely dynamic programming resolves state and input."""

from typing import Annotated, Literal, NamedTuple, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from qpmpc.verification.dynamic_programming.threads import THREADS_MAX

CELLS_MAX = 4e6
"""Of one grid: some gigabytes, as its values at some tens of seconds are kept."""

T_CL_RANGE_K = 100.0


class Cells(NamedTuple):
    """Coarse cells in SOC and T, spacing of the engine power, fine cells in one coarse."""

    soc_step: float
    t_cl_step_k: float
    power_step_w: float
    refinement: int


class Tube(NamedTuple):
    """Half widths in SOC and T, and fine cells in one coarse, along each axis."""

    soc: float
    t_cl_k: float
    refinement: int


SHORT_S = 300.0
"""On shorter trips a cell of the quick grid would be too large a part of what is burnt."""

GRIDS = {"reference": Cells(0.002, 0.5, 500.0, 8), "quick": Cells(0.004, 1.0, 1000.0, 4)}


class DpSettings(BaseModel):
    """Grid of the state and the input; `cells` are those that it comes to.

    Two levels are solved: the whole box of limits on a coarse grid, then a tube around the
    coarse trajectory whose cells are `refinement` times smaller in SOC and in T. The tube moves
    and widens until the optimal trajectory stays clear of its edges.

    Attributes
    ----------
    grid : `reference`, or `quick`, ten times as fast; see docs/dynamic_programming.md for errors
    soc_step, t_cl_step_k : cells of the coarse grid, 1 and K; in SOC less, by its energy, with a
        battery of more than 6 MJ, and so is the tube (`levels.LARGEST_J`)
    power_step_w : spacing of the engine power in the backward pass; the forward pass refines it
    refinement : cells of the tube in one coarse cell, along each axis. Each of these four, if
        given, takes the place of the reference's; `quick` comes with its own and allows none
    tube_soc, tube_t_cl_k : half widths of the tube at first, 1 and K; on trips of less than 300 s
        `quick` takes half of them, and halves the tube's cells
    threads : processor cores to use; if None those of `threads.default_threads`; does not change
        the result
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    grid: Literal["reference", "quick"] = "reference"
    soc_step: Annotated[float, Field(ge=1e-4, le=0.1)] | None = None
    t_cl_step_k: Annotated[float, Field(ge=0.01, le=10.0)] | None = None
    power_step_w: Annotated[float, Field(ge=10.0, le=10e3)] | None = None
    refinement: Annotated[int, Field(ge=1, le=256)] | None = None
    tube_soc: Annotated[float, Field(ge=1e-3, le=1.0)] = 0.04
    tube_t_cl_k: Annotated[float, Field(ge=0.1, le=100.0)] = 5.0
    threads: Annotated[int, Field(ge=1, le=THREADS_MAX)] | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.grid != "reference" and self._given():
            raise ValueError(
                f"grid {self.grid!r} has its own {', '.join(self._given())}: give one or the other"
            )
        soc_step, t_cl_step_k, _, refinement = self.cells
        box = T_CL_RANGE_K / (soc_step * t_cl_step_k)
        cell = soc_step * t_cl_step_k / refinement**2
        tube = 4.0 * self.tube_soc * self.tube_t_cl_k / cell
        for cells, keys in ((box, "soc_step, t_cl_step_k"), (tube, "tube_soc, tube_t_cl_k")):
            if cells > CELLS_MAX:
                raise ValueError(f"{keys} make {cells:.2g} cells, at most {CELLS_MAX:.2g}")
        return self

    def _given(self) -> dict[str, float]:
        values = ((name, getattr(self, name)) for name in Cells._fields)
        return {name: value for name, value in values if value is not None}

    @property
    def cells(self) -> Cells:
        """Spacings of the named grid, each replaced by the one that is given."""
        return Cells(**(GRIDS[self.grid]._asdict() | self._given()))

    def tube(self, duration_s: float) -> Tube:
        """Return the first tube of a trip of that duration."""
        tube = Tube(self.tube_soc, self.tube_t_cl_k, self.cells.refinement)
        if self.grid != "quick" or duration_s >= SHORT_S:
            return tube
        return Tube(0.5 * tube.soc, 0.5 * tube.t_cl_k, 2 * tube.refinement)

    @classmethod
    def quick(cls) -> "DpSettings":
        """Coarser grids for quick use; see docs/dynamic_programming.md for their error."""
        return cls(grid="quick")

    def doubled(self) -> "DpSettings":
        """Halve every spacing of the tube: cells in SOC and T, and the engine power."""
        soc_step, t_cl_step_k, power_step_w, refinement = self.cells
        finer = Cells(soc_step, t_cl_step_k, 0.5 * power_step_w, 2 * refinement)
        return self.model_copy(update={"grid": "reference", **finer._asdict()})
