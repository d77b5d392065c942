"""What a comparison found, in sentences made from its figures: its report begins with them."""

from collections.abc import Sequence

from qpmpc.report.columns import Row, balanced_fuel_g
from qpmpc.results import OPTIMUM, REFERENCE

DIGITS = 2  # of percentages, as in the table
MOST_NAMED = 6  # runs in a sentence

# controller that a percentage refers to, its key, and its sign for "more fuel than"
REFERENCES = (
    (REFERENCE, "saving_vs_rule_percent", -1.0),
    (OPTIMUM, "fuel_above_dp_percent", 1.0),
)


def comparison_answer(rows: Sequence[Row]) -> list[str]:
    """Return who burns least and by how much, then whatever speaks against it.

    Only runs that kept all limits and can be compared in fuel count. The optimum knows the trip
    and is no candidate. No percentage is stated against a run that cannot be compared.

    Parameters
    ----------
    rows : as `compare_runs` returns them
    """
    violated = [row for row in rows if any(row["violations"].values())]
    others = [row for row in rows if not row["comparable"] and row not in violated]
    fallback = [f"{_run(row)} ({row['fallback_steps']} s)" for row in rows if row["fallback_steps"]]
    sentences = [_least(rows)]
    sentences.append(
        f"A limit was violated by {some([_run(row) for row in violated])}."
        if violated
        else "No limit was violated."
    )
    if others:
        sentences.append(f"Not comparable in fuel: {some([_run(row) for row in others])}.")
    if fallback:
        sentences.append(f"A fallback drove in place of the optimiser: {some(fallback)}.")
    return sentences


def some(names: Sequence[str]) -> str:
    """Return names in a row, the many shortened to a count."""
    left = len(names) - MOST_NAMED
    return ", ".join(names[:MOST_NAMED]) + (f" and {left} more" if left > 0 else "")


def _run(row: Row) -> str:
    return f"{row['controller']} on {row['cycle']}"


def is_sound(row: Row) -> bool:
    """Whether the fuel of a run counts."""
    return bool(row["comparable"]) and not any(row["violations"].values())


def _least(rows: Sequence[Row]) -> str:
    cycles = list(dict.fromkeys(row["cycle"] for row in rows))
    drove = [row for row in rows if row["controller"] != OPTIMUM]
    sound = [row for row in drove if is_sound(row)]
    if not sound:
        but = " but the optimum's" if len(drove) < len(rows) else ""
        return f"No run{but} can be compared in fuel."
    best = {}
    for cycle in cycles:
        own = [row for row in sound if row["cycle"] == cycle]
        if own:
            best[cycle] = min(own, key=balanced_fuel_g)
    won = [row["controller"] for row in best.values()]
    name = max(dict.fromkeys(won), key=won.count)
    own = [row for row in sound if row["controller"] == name]
    against = "".join(f", {text}" for text in _against(rows, own))
    alone = len({row["controller"] for row in drove}) == 1
    if len(cycles) == 1:
        burns = "burns" if alone else "burns least:"
        fuel = f"{balanced_fuel_g(own[0]):.1f} g of fuel, SOC-balanced"
        return f"On {cycles[0]}, {name} {burns} {fuel}{against}."
    if alone:
        return f"{name} drove {len(own)} of {len(cycles)} cycles comparably{against}."
    where = f"{won.count(name)} of {len(cycles)}"
    if won.count(name) == len(cycles):
        where = "both" if len(cycles) == 2 else f"all {len(cycles)}"
    return f"{name} burns least on {where} cycles{against}."


def _against(rows: Sequence[Row], own: Sequence[Row]) -> list[str]:
    """Differences from the references, over the cycles on which both can be compared."""
    plant = own[0].get("plant")
    references = list(REFERENCES)
    if plant is not None:
        references.append((plant["name"], "saving_vs_own_control_percent", -1.0))
    trusted = {(row["cycle"], row["controller"]) for row in rows if is_sound(row)}
    found = []
    for reference, key, sign in references:
        if reference == own[0]["controller"]:
            continue
        more = [
            sign * row[key]
            for row in own
            if row.get(key) is not None and (row["cycle"], reference) in trusted
        ]
        if more:
            where = "" if len(more) == len(own) else f" on {len(more)} of them"
            found.append(f"{difference(min(more), max(more))} than {reference}{where}")
    return found


def difference(least: float, most: float) -> str:
    """Return a range of percentages in words, "1.20 to 3.00 % less": positive is more fuel."""
    low, high = (f"{abs(value):.{DIGITS}f}" for value in (least, most))
    if float(low) == float(high) == 0.0:
        return f"{low} % more"
    if low == high and (least < 0.0) == (most < 0.0):
        return f"{low} % {'less' if least < 0.0 else 'more'}"
    if most <= 0.0:
        return f"{high} to {low} % less"
    if least >= 0.0:
        return f"{low} to {high} % more"
    return f"between {low} % less and {high} % more"
