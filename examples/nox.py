"""A proxy of NOx in our program, priced against fuel. Its numbers are assumptions, not a map's."""

import cvxpy as cp
import numpy as np

import qpmpc

# ASSUMED: engine-out NOx of one stoichiometric engine, mg/s = slope * kW + offset where it is on;
# convex, steep near full power. Put in the tangents of your own map.
SLOPE_MG_PER_KJ = np.array([0.5, 1.5, 4.0])
OFFSET_MG_PER_S = np.array([1.0, -9.0, -71.5])  # the pieces meet at 10 and 25 kW
PRICE_G_PER_MG = 0.01  # grams of fuel that a milligram of NOx is worth: 10 to 1


class LowNox(qpmpc.CvxpyPlanner):
    name = "low-nox"

    def terms(self, program):
        pieces = [
            slope * program.p_eng_w / 1e3 + offset * program.on
            for slope, offset in zip(SLOPE_MG_PER_KJ, OFFSET_MG_PER_S, strict=True)
        ]
        nox_mg_per_s = cp.Variable(program.stages, name="nox")
        nox_mg = program.given("duration_s") @ nox_mg_per_s
        return PRICE_G_PER_MG * nox_mg, [nox_mg_per_s >= piece for piece in pieces]


def nox_mg(run):
    """Return the proxy's NOx of a run as driven."""
    made = run.trajectory
    pieces = np.outer(SLOPE_MG_PER_KJ, made.p_eng_w / 1e3) + OFFSET_MG_PER_S[:, None]
    return np.where(made.engine_on, pieces.max(axis=0), 0.0).sum()


runs = qpmpc.compare("nycc", ["mh-qp", LowNox], figures={"nox_mg": nox_mg})
print(runs)
