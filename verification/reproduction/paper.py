"""The paper's printed figures, for comparison only; nothing here enters a computation.

Q. Hu, M. R. Amini, H. Wang, I. Kolmanovsky, J. Sun, "Integrated Power and Thermal Management of
Connected HEVs via Multi-Horizon MPC", American Control Conference 2020. Savings are over its
rule-based controller.
"""

CYCLES = ("nycc", "nedc-truncated")
HORIZONS_S = (20, 50, 100)

SAVING_PERCENT: dict[tuple[str, str], float] = {
    ("nycc", "dp"): 19.9,
    ("nycc", "mh"): 17.6,
    ("nedc-truncated", "dp"): 4.8,
    ("nedc-truncated", "mh"): 4.62,
    ("nedc-truncated", "baseline H=20"): 1.37,
    ("nedc-truncated", "baseline H=100"): 1.84,
}
# The text has "up to" for NYCC and does not give the horizon.
BASELINE_BEST_NYCC_PERCENT = 15.3

STEP_TIME_S: dict[str, float] = {"baseline H=20": 0.46, "baseline H=100": 2.12, "mh": 0.67}
COMPUTER = "Intel i7-8700"


def above_dp_percent(cycle: str, name: str) -> float | None:
    """Fuel above DP that follows from two printed savings, 100 ((1 - s) / (1 - s_dp) - 1)."""
    saving = SAVING_PERCENT.get((cycle, name))
    if saving is None:
        return None
    return 100.0 * ((100.0 - saving) / (100.0 - SAVING_PERCENT[cycle, "dp"]) - 1.0)
