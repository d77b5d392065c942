"""What a fault did: what drove, for how long, what it cost, when it was over."""

from collections import Counter
from typing import Any

import numpy as np

from qpmpc.faults.models import Fault
from qpmpc.results import Run, flag_seconds

NEAR_SOC, NEAR_K = 1e-3, 0.1  # from the unfaulted trajectory, which then counts as met
OWN = "own decision"  # of the controller: no rung of the ladder


def effect(fault: Fault, faulted: Run, unfaulted: Run) -> dict[str, Any]:
    """Return what a fault did, as plain data.

    `met_again_s` is the first second from which on SOC and coolant are within NEAR_SOC and NEAR_K
    of the unfaulted run until the arrival, at the earliest the fault's first; null if there is
    none. `drove` and `flags` count seconds from the begin of the fault until it is over and that
    second is reached. Fuel is SOC-balanced.

    Parameters
    ----------
    faulted : run with this fault alone
    unfaulted : the same without
    """
    trajectory, steps = faulted.trajectory, len(faulted.trajectory.fuel_g)
    met_s = met_again_s(faulted, unfaulted, fault.at_s)
    span = slice(fault.at_s, steps if met_s is None else min(max(met_s, fault.end_s), steps))
    return {
        **fault.model_dump(),
        "what": fault.what,
        "drove": dict(Counter(rung or OWN for rung in trajectory.fallback[span])),
        "flags": flag_seconds(trajectory.flags[span]),
        **fuel_change(faulted, unfaulted),
        "violations": _added(faulted, unfaulted),
        "met_again_s": met_s,
    }


def fuel_change(faulted: Run, unfaulted: Run) -> dict[str, float | None]:
    """Return the change of SOC-balanced fuel, and its share; null where none is burnt."""
    before = unfaulted.fuel_soc_balanced_g
    change = faulted.fuel_soc_balanced_g - before
    return {"fuel_g": change, "fuel_percent": 100.0 * change / before if before > 0.0 else None}


def met_again_s(faulted: Run, unfaulted: Run, from_s: int) -> int | None:
    """Return the second from which on a run stays near another; see `effect`."""
    one, other = faulted.trajectory, unfaulted.trajectory
    apart = (np.abs(one.soc - other.soc) >= NEAR_SOC) | (
        np.abs(one.t_cl_degc - other.t_cl_degc) >= NEAR_K
    )
    if apart[-1]:
        return None
    return max(from_s, *(np.flatnonzero(apart) + 1).tolist()[-1:], 0)


def sentence(number: int, found: dict[str, Any]) -> str:
    """Return the effect of a fault in one line."""
    drove = ", ".join(f"{rung} {seconds} s" for rung, seconds in found["drove"].items())
    flags = ", ".join(f"{name} {seconds} s" for name, seconds in found["flags"].items())
    met_s, excess = found["met_again_s"], found["violations"]
    violated = [
        text
        for value, text in (
            (excess["soc"], f"SOC by {excess['soc']:.2g}"),
            (excess["t_cl_degc"], f"coolant by {excess['t_cl_degc']:.2g} K"),
            (excess["power_w"], f"power by {excess['power_w']:.3g} W"),
        )
        if value > 0.0
    ]
    met = "met again at " + str(met_s) + " s" if met_s != found["at_s"] else "never left"
    return (
        f"fault {number}, {found['what']} at {found['at_s']} s for {found['for_s']} s: "
        f"fuel {_change(found)}; unfaulted trajectory {'not met again' if met_s is None else met}; "
        f"until then drove {drove}; flags: {flags or 'none'}"
        + (f"; limits violated by more: {', '.join(violated)}" if violated else "")
    )


def _change(found: dict[str, Any]) -> str:
    share = found["fuel_percent"]
    return f"{found['fuel_g']:+.3f} g" + ("" if share is None else f" ({share:+.3f} %)")


def sentences(faults: dict[str, Any]) -> list[str]:
    """Return the effects of all faults of a run, one line each, and that of all together."""
    each = faults["each"]
    lines = [sentence(number, found) for number, found in enumerate(each, start=1)]
    if len(each) > 1:
        lines.append(f"all {len(each)} faults together: fuel {_change(faults)}")
    return lines


def _added(faulted: Run, unfaulted: Run) -> dict[str, float]:
    """Excess over the limits beyond that of the unfaulted run."""
    fields = {"soc": "soc", "t_cl_degc": "t_cl_k", "power_w": "power_w"}
    most = [
        {name: float(getattr(run.excess, field).max()) for name, field in fields.items()}
        for run in (unfaulted, faulted)
    ]
    return {name: max(most[1][name] - most[0][name], 0.0) for name in fields}
