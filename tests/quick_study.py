"""A study of 60 runs of some 50 ms each, and what is equal in two results of it."""

import json
from pathlib import Path
from typing import Any

from qpmpc.study.columns import TIMES
from qpmpc.study.results import StudyResults

QUICK: dict[str, Any] = {
    "name": "quick",
    "fixed": {"cycle": "nycc", "controller": "rule-based", "rule_based.balance": False},
    "grid": {"thermal.t_amb_degc": [-20, -10, 0], "vehicle": ["prius-nimh", "prius-liion"]},
    "sample": {"count": 10, "values": {"trip.soc_init": {"uniform": [0.45, 0.75]}}},
}


def values(folder: Path) -> Any:
    """Return all that does not depend on how fast the machine is."""
    return StudyResults(folder).frame().drop(columns=list(TIMES))


def as_toml(study: dict[str, Any], file: Path) -> Path:
    """JSON's numbers, strings and arrays are TOML's."""
    lines = [f"name = {json.dumps(study['name'])}"]
    for table in ("fixed", "grid"):
        lines += [f"[{table}]"]
        lines += [f'"{key}" = {json.dumps(value)}' for key, value in study[table].items()]
    sample = study["sample"]
    lines += ["[sample]", f"count = {sample['count']}", "[sample.values]"]
    lines += [
        f'"{key}" = {{uniform = {json.dumps(how["uniform"])}}}'
        for key, how in sample["values"].items()
    ]
    file.write_text("\n".join(lines) + "\n")
    return file
