"""cvxpy in closed loop: our program with a term of your own, which smooths the engine's power."""

import cvxpy as cp

import qpmpc


class Gentle(qpmpc.CvxpyPlanner):
    name = "gentle"

    def terms(self, program):
        change_kw = cp.diff(program.p_eng_w[:20]) / 1e3  # over the 20 s of accurate preview
        return 0.002 * cp.norm1(change_kw), []


print(qpmpc.compare("nycc", ["mh-qp", Gentle]))
