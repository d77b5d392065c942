"""A limit on engine starts in our program: at most 2 in 200 s, beyond that 5 g of fuel for each."""

from collections import deque

import cvxpy as cp

import qpmpc

MOST, WINDOW_S, PRICE_G = 2, 200, 5.0


class FewStarts(qpmpc.CvxpyPlanner):
    name = "few-starts"

    def terms(self, program):
        self.left = cp.Parameter(name="starts_left", nonneg=True)
        ahead = cp.sum(program.starts[: self.preview.settings.short_stages])
        return PRICE_G * cp.pos(ahead - self.left), []

    def depart(self, seen):
        super().depart(seen)
        self.at_s, self.was_on = deque(), False  # what the controller itself has seen

    def plan(self, seen):
        if seen.engine_on and not self.was_on:
            self.at_s.append(seen.step)
        self.was_on = seen.engine_on
        while self.at_s and self.at_s[0] <= seen.step - WINDOW_S:
            self.at_s.popleft()
        self.left.value = max(MOST - len(self.at_s), 0)
        return super().plan(seen)


def most_starts(run):
    """Return the most starts in any window."""
    at_s = [step for step, started in enumerate(run.trajectory.started) if started]
    return max((sum(first <= s < first + WINDOW_S for s in at_s) for first in at_s), default=0)


runs = qpmpc.compare("nycc", ["mh-qp", FewStarts], figures={"most_starts_in_200_s": most_starts})
print(runs)
