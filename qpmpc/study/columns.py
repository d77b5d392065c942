"""Columns of a study's results: one row per run, the keys of its JSON with dots."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from qpmpc.controllers.monitor import Flag
from qpmpc.study.definition import Study

if TYPE_CHECKING:
    import pyarrow

PARAMETERS: dict[str, type] = {
    "run": int,
    "cycle": str,
    "vehicle": str,
    "controller": str,
    "forecast": str,
    "faults": str,
    "seed": int,
}
FLAGS: dict[str, type] = {f"flags.{name}": int for flag in Flag for name in flag.names()}
FIGURES: dict[str, type] = {
    "duration_s": int,
    "distance_km": float,
    "fuel_g": float,
    "fuel_soc_balanced_g": float,
    "comparable": bool,
    "soc_init": float,
    "soc_end": float,
    "soc_min": float,
    "soc_max": float,
    "t_cl_min_degc": float,
    "t_cl_max_degc": float,
    "t_cl_end_degc": float,
    "engine_starts": int,
    "engine_on_share": float,
    "violations.soc": float,
    "violations.t_cl_degc": float,
    "violations.power_w": float,
    "fallback_steps": int,
    "certificate_g.max": float,
    "certificate_g.mean": float,
    "relaxation_gap.max": float,
    "relaxation_gap.mean": float,
    "sigma_integral_share": float,
    "step_time_ms.median": float,
    "step_time_ms.p99": float,
    "step_time_ms.max": float,
    "solver.name": str,
    "solver.implementation": str,
    "solver.iterations_max": int,
    "solver.iterations_median": float,
    "remarks": list,
    **FLAGS,
    "engine_starts_per_km": float,
    "engine_on_s.min": int,
    "engine_on_s.median": float,
    "engine_runs_below_3s_share": float,
    "engine_runs_below_min_on_s": int,
    "fuel_starts_g": float,
    "friction_brake_j": float,
    "fuel_expected_g": float,
    "fuel_off_expected_percent": float,
    "soc_end_target": float,
    "soc_end_at_least": bool,
    "battery_used_kwh": float,
    "soc_price_g": float,
    "faults_effect": str,
}
PROVENANCE: dict[str, type] = {
    "error": str,
    "wall_s": float,
    "trip_hash": str,
    "inputs_hash": str,
    "code_hash": str,
    "versions": str,
}
# Of a run made again they differ: they are times.
TIMES = ("step_time_ms.median", "step_time_ms.p99", "step_time_ms.max", "wall_s")
SETTING = "set."  # before the dotted name of a setting


def columns(study: Study) -> dict[str, type]:
    """Return the name and type of every column of a study, in order."""
    settings = {SETTING + key: study.kind_of(key) for key in study.settings}
    return {**PARAMETERS, **settings, **FIGURES, **PROVENANCE}


def schema(study: Study) -> "pyarrow.Schema":
    """Return the same for Parquet."""
    import pyarrow as pa

    kinds = {int: pa.int64(), float: pa.float64(), bool: pa.bool_(), str: pa.string()}
    kinds[list] = pa.list_(pa.string())
    return pa.schema([(name, kinds[kind]) for name, kind in columns(study).items()])


def flat(data: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return nested figures with dotted names."""
    found: dict[str, Any] = {}
    for key, value in data.items():
        if isinstance(value, Mapping):
            found |= flat(value, f"{prefix}{key}.")
        else:
            found[prefix + key] = value
    return found
