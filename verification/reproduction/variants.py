"""The controllers compared, the paper's and ours, and the extent of a reproduction."""

from dataclasses import dataclass, field

from qpmpc.cycles import Cycle, cycle_names, load_cycle
from qpmpc.verification.dynamic_programming import DpSettings
from qpmpc.verification.reproduction import paper


@dataclass(frozen=True)
class Variant:
    """A controller with its own settings.

    Attributes
    ----------
    label : its name in reports
    controller : its name
    settings : dotted settings on top of the user's
    """

    label: str
    controller: str
    settings: dict[str, object] = field(default_factory=dict)


RULES, OURS, PAPER_GRID, OPTIMUM = "rule-based", "mh-qp", "mh-qp-paper", "dp"


def baseline(horizon_s: int) -> str:
    """Label of the baseline MPC with a horizon."""
    return f"baseline H={horizon_s}"


VARIANTS = (
    Variant(RULES, RULES),
    *(
        Variant(baseline(horizon_s), "baseline-mpc", {"baseline_mpc.horizon_s": horizon_s})
        for horizon_s in paper.HORIZONS_S
    ),
    Variant("ecms", "ecms"),
    Variant(PAPER_GRID, PAPER_GRID),
    Variant(OURS, OURS),
    Variant(OPTIMUM, OPTIMUM),
)

LATE_HEAT = "rules, heat request 42/44 °C"

# Each tests one cause of a distance from dynamic programming or a saving.
EXPERIMENTS = (
    Variant(
        "paper's grid, 3 demand classes per block",
        PAPER_GRID,
        {"mh_qp_paper.horizon.classes": 3},
    ),
    Variant("paper's grid, blocks of 5 s", PAPER_GRID, {"mh_qp_paper.horizon.block_s": 5}),
    Variant("paper's grid, 1000 iterations", PAPER_GRID, {"mh_qp_paper.admm.iterations": 1000}),
    Variant(
        "baseline H=20, 1000 iterations",
        "baseline-mpc",
        {"baseline_mpc.horizon_s": 20, "baseline_mpc.admm.iterations": 1000},
    ),
    Variant(
        "baseline H=100, 1000 iterations",
        "baseline-mpc",
        {"baseline_mpc.horizon_s": 100, "baseline_mpc.admm.iterations": 1000},
    ),
    Variant(
        "rules, on above 5 kW, at least 5 kW",
        RULES,
        {"rule_based.on_w": 5e3, "rule_based.power_min_w": 5e3},
    ),
    Variant("rules, at least 12 kW", RULES, {"rule_based.power_min_w": 12e3}),
    Variant(
        "rules, heat from 8 kW",
        RULES,
        {"rule_based.heat_power_w": 8e3},
    ),
    Variant(
        LATE_HEAT,
        RULES,
        {"rule_based.heat_on_degc": 42.0, "rule_based.heat_off_degc": 44.0},
    ),
)


@dataclass(frozen=True)
class Extent:
    """Extent of a reproduction.

    Attributes
    ----------
    cycles : the paper's two
    others : further cycles, on which no paper's figure exists
    seeds : forecasts of each error model on each cycle
    dp : grid of dynamic programming instead of the user's, if any
    snapshot_step : time step of the picture of a horizon, on the first cycle
    """

    cycles: tuple[Cycle, ...]
    others: tuple[Cycle, ...]
    seeds: int
    snapshot_step: int
    dp: DpSettings | None = None

    @property
    def all_cycles(self) -> tuple[Cycle, ...]:
        """The paper's and the others."""
        return (*self.cycles, *self.others)

    @classmethod
    def full(cls) -> "Extent":
        """Everything: all shipped cycles, 60 forecasts on each."""
        others = tuple(load_cycle(name) for name in cycle_names() if name not in paper.CYCLES)
        cycles = tuple(load_cycle(name) for name in paper.CYCLES)
        return cls(cycles, others, seeds=10, snapshot_step=200)

    @classmethod
    def quick(cls) -> "Extent":
        """The first two minutes of each of the paper's cycles, few forecasts, a coarse grid."""
        cycles = tuple(_beginning(load_cycle(name), 120) for name in paper.CYCLES)
        grid = DpSettings(soc_step=0.004, t_cl_step_k=1.0, power_step_w=1000.0, refinement=2)
        return cls(cycles, (), seeds=1, snapshot_step=30, dp=grid)


def _beginning(cycle: Cycle, steps: int) -> Cycle:
    end = steps + 1
    return Cycle(cycle.name, cycle.time_s[:end], cycle.speed_mps[:end], cycle.grade[:end])
