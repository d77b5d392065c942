"""Dynamic programming as a controller: its plan, replayed on the plant."""

from collections.abc import Callable, Sequence

from qpmpc.controllers.base import Progress
from qpmpc.controllers.replay import Replay
from qpmpc.vehicle.plant import Command
from qpmpc.verification.dynamic_programming.settings import DpSettings
from qpmpc.verification.dynamic_programming.solve_dp import solve_dp

PARTS = 1000  # of the progress


class Dp(Replay):
    """The optimum of the trip: knows the whole cycle and the plant."""

    name = "dp"
    Settings = DpSettings

    def commands(self, progress: Progress | None) -> Sequence[Command]:
        """Solve the trip, or take its solution from the cache."""
        grid = self.settings.of("dp", DpSettings())
        report = None if progress is None else as_fraction(progress)
        plan = solve_dp(self.trip.cycle, self.trip.vehicle, grid, report)
        if not plan.admissible:
            self.reservations.append(
                "dynamic programming found nothing that keeps all limits and the final SOC"
            )
        elif not plan.converged:
            self.remarks.append(
                f"dp: on {plan.cycle} the optimum still touches the edge of its tube after "
                f"{len(plan.levels) - 1} tubes: its fuel may be too high"
            )
        self.soc_price_g = plan.soc_price_g(self.trip.vehicle.battery)
        pairs = zip(plan.engine_on.tolist(), plan.p_eng_w.tolist(), strict=True)
        return [Command(on, p_eng_w) for on, p_eng_w in pairs]


def as_fraction(progress: Progress) -> Callable[[float], None]:
    """Turn a progress that counts parts into one that takes the finished fraction."""
    return lambda fraction: progress(round(fraction * PARTS), PARTS)
