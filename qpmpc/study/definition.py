"""What a study runs: its file, and the parameters of each of its runs."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import product
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, model_validator

from qpmpc.cycles.trips import SETS
from qpmpc.cycles.trips.names import SEEDS
from qpmpc.names import unknown
from qpmpc.registry import reads
from qpmpc.study.sampling import KINDS, Sample, Value, points_of
from qpmpc.vehicle.names import DEFAULT_VEHICLE

RUNS_MAX = 1_000_000
INTEGER_END = 2**63  # of the columns of Parquet
OF_RUN = ("cycle", "vehicle", "controller", "forecast", "faults", "seed")
TRUE_FORECAST = "true"
_RANDOM = re.compile(r"random(-[0-9]+s)?")


@dataclass(frozen=True)
class Parameters:
    """One run of a study.

    Attributes
    ----------
    run : its number, from 0
    cycle, vehicle, controller : as of `qpmpc.simulate`
    forecast : `true`, or a model of `qpmpc.preview.forecast_errors`
    faults : file of the faults injected, none if None
    seed : of the forecast's error and of a random trip
    settings : dotted, those without effect on the controller left out
    """

    run: int
    cycle: str
    vehicle: str
    controller: str
    forecast: str
    faults: str | None
    seed: int
    settings: dict[str, Value]


class Study(BaseModel):
    """A study, as its TOML file has it.

    The runs are all combinations of each sample, each point and each value of the grid. A key is
    one of `OF_RUN` or the dotted name of a setting. A value of the grid that has no effect on a
    controller makes no further run of it.

    Attributes
    ----------
    name, description : what it is called, and what it asks
    seed : of the samples; run i of a sample has the seed ``seed + i`` unless `seed` is a key
    trajectories : whether to keep the trajectory of each run
    fixed : keys with one value
    grid : keys with several values, all combined
    points : tables of keys, one after the other
    sample : keys with random values, see `Sample`
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]{0,59}$")]
    description: Annotated[str, Field(max_length=10_000)] = ""
    seed: Annotated[int, Field(ge=0, le=2**31 - 1)] = 0
    trajectories: bool = False
    fixed: dict[str, Value] = Field(default_factory=dict)
    grid: dict[str, Annotated[list[Value], Field(min_length=1)]] = Field(default_factory=dict)
    points: list[dict[str, Value]] = Field(default_factory=list)
    sample: Sample | None = None

    @model_validator(mode="before")
    @classmethod
    def _flatten(cls, data: Any) -> Any:
        """Let ``thermal.t_amb_degc = -7`` be the key of that name, quoted or not."""
        if not isinstance(data, Mapping):
            return data
        data = {**data}
        for part in ("fixed", "grid"):
            if isinstance(data.get(part), Mapping):
                data[part] = _flat(data[part])
        if isinstance(data.get("points"), list):
            data["points"] = [_flat(p) if isinstance(p, Mapping) else p for p in data["points"]]
        sample = data.get("sample")
        if isinstance(sample, Mapping) and isinstance(sample.get("values"), Mapping):
            data["sample"] = {**sample, "values": _flat(sample["values"])}
        return data

    @model_validator(mode="after")
    def _check(self) -> "Study":
        places = {
            "fixed": set(self.fixed),
            "grid": set(self.grid),
            "points": {key for point in self.points for key in point},
            "sample": set(self.sample.values) if self.sample else set(),
        }
        for key in sorted({key for keys in places.values() for key in keys}):
            inside = [place for place, keys in places.items() if key in keys]
            if len(inside) > 1:
                raise ValueError(f"{key} is in {' and in '.join(inside)}: give it in one of them")
            if key not in OF_RUN and "." not in key:
                raise ValueError(unknown("key", key, OF_RUN, ", or a setting's dotted name"))
            values = self._given(key)
            kinds = {type(value) for value in values}
            if len(kinds) > 1 and kinds != {int, float}:
                raise ValueError(f"{key} has values of several kinds")
            if any(type(value) is int and abs(value) >= INTEGER_END for value in values):
                raise ValueError(f"{key} has an integer of more than 64 bits")
        for key, values in self.grid.items():
            if len(set(values)) < len(values):
                raise ValueError(f"grid.{key} has a value twice")
        for key in OF_RUN:
            for value in self.values_of(key):
                if isinstance(value, str) == (key == "seed") or isinstance(value, bool):
                    kind = "an integer" if key == "seed" else "text"
                    raise ValueError(f"{key} must be {kind} (given: {value!r})")
                if key == "seed" and not (isinstance(value, int) and 0 <= value < SEEDS):
                    raise ValueError(f"seed must be an integer, 0 or more (given: {value!r})")
        self._check_cycles(places["points"])
        if self.sample and "seed" not in self.keys and self.seed + self.sample.count > SEEDS:
            raise ValueError(f"seed + count is {self.seed + self.sample.count}, at most {SEEDS}")
        if self.combinations > RUNS_MAX:
            raise ValueError(f"{self.combinations} combinations, at most {RUNS_MAX} are allowed")
        return self

    def _check_cycles(self, of_points: set[str]) -> None:
        if not self.values_of("cycle"):
            raise ValueError("no cycle: give it in fixed, grid, points or sample")
        without = [i for i, point in enumerate(self.points, start=1) if "cycle" not in point]
        if "cycle" in of_points and without:
            raise ValueError(f"no cycle in point {without[0]}: give one in each, or in none")
        for one in (self.fixed, *self.points):
            if one.get("cycle") in SETS:
                raise ValueError(f"cycle {one['cycle']!r} is a set of trips: give it in grid")

    @property
    def combinations(self) -> int:
        """Number of combinations, those of no effect on their controller included."""
        count = (self.sample.count if self.sample else 1) * (len(self.points) or 1)
        for values in self.grid.values():
            count *= len(values)
        return count

    @cached_property
    def keys(self) -> tuple[str, ...]:
        """All keys, in the order of the file, fixed ones first."""
        of_points = [key for point in self.points for key in point]
        sampled = self.sample.values if self.sample else {}
        return tuple(dict.fromkeys([*self.fixed, *sampled, *of_points, *self.grid]))

    @property
    def varied(self) -> tuple[str, ...]:
        """Keys with more than one value."""
        return tuple(key for key in self.keys if key not in self.fixed)

    @property
    def settings(self) -> tuple[str, ...]:
        """Keys that are settings."""
        return tuple(key for key in self.keys if key not in OF_RUN)

    @property
    def idle(self) -> tuple[str, ...]:
        """Keys that have no effect on any controller of the study."""
        names = [str(name) for name in self.values_of("controller")] or ["mh-qp"]
        return tuple(k for k in self.keys if not any(_has_effect(name, k) for name in names))

    def values_of(self, key: str) -> list[Value]:
        """Return all values that a key takes; of an interval both ends."""
        return list(dict.fromkeys(self._given(key)))

    def _given(self, key: str) -> list[Value]:
        found: list[Value] = [self.fixed[key]] if key in self.fixed else []
        found += self.grid.get(key, [])
        found += [point[key] for point in self.points if key in point]
        if self.sample and key in self.sample.values:
            found += self.sample.values[key].ends
        return found

    def kind_of(self, key: str) -> type:
        """Return the type of a key's values: bool, int, float or str."""
        kinds = {type(value) for value in self.values_of(key)}
        return float if kinds == {int, float} else kinds.pop()

    def runs(self) -> Iterator[Parameters]:
        """Make the parameters of all runs, one at a time, always in the same order."""
        for run, combination in enumerate(self._combinations()):
            yield Parameters(run=run, **combination)

    @cached_property
    def count(self) -> int:
        """Number of runs."""
        return sum(1 for _ in self._combinations())

    def _combinations(self) -> Iterator[dict[str, Any]]:
        sampled = points_of(self.sample, self.seed) if self.sample else iter([{}])
        points = self.points or [{}]
        first = cache(self._first_equal)
        for i, values in enumerate(sampled):
            for number, point in enumerate(points):
                for indices in product(*(range(len(v)) for v in self.grid.values())):
                    chosen = {k: self.grid[k][j] for k, j in zip(self.grid, indices, strict=True)}
                    keys = {**self.fixed, **values, **point, **chosen}
                    controller = str(keys.get("controller", "mh-qp"))
                    idle = {key for key in keys if not _has_effect(controller, key)}
                    again = any(
                        j and key in idle for key, j in zip(self.grid, indices, strict=True)
                    )
                    if again or number != first(controller)[number]:
                        continue
                    yield _combined({k: v for k, v in keys.items() if k not in idle}, self.seed + i)

    def _first_equal(self, controller: str) -> list[int]:
        """Return for each point the first that is the same to a controller."""
        firsts: dict[frozenset[tuple[str, Value]], int] = {}
        return [
            firsts.setdefault(
                frozenset((k, v) for k, v in point.items() if _has_effect(controller, k)), number
            )
            for number, point in enumerate(self.points or [{}])
        ]


def _combined(keys: Mapping[str, Value], seed: int) -> dict[str, Any]:
    number = int(keys.get("seed", seed))
    return {
        "cycle": with_seed(str(keys["cycle"]), number),
        "vehicle": str(keys.get("vehicle", DEFAULT_VEHICLE)),
        "controller": str(keys.get("controller", "mh-qp")),
        "forecast": str(keys.get("forecast", TRUE_FORECAST)),
        "faults": str(keys["faults"]) if "faults" in keys else None,
        "seed": number,
        "settings": {key: value for key, value in keys.items() if key not in OF_RUN},
    }


def with_seed(cycle: str, seed: int) -> str:
    """Complete ``random`` or ``random-600s`` by a seed; other names stay."""
    found = _RANDOM.fullmatch(cycle)
    return f"random-{seed}{found[1] or ''}" if found else cycle


@cache
def _has_effect(controller: str, key: str) -> bool:
    if key in OF_RUN and key != "forecast":
        return True
    return reads(controller, key)


def _flat(table: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Make dotted names of tables in tables; a distribution is a value."""
    found: dict[str, Any] = {}
    for key, value in table.items():
        is_table = isinstance(value, Mapping) and value and not set(value) <= set(KINDS)
        inner = _flat(value, f"{prefix}{key}.") if is_table else {prefix + key: value}
        for again in set(inner) & set(found):
            raise ValueError(f"{again} is given twice, with quotes and without")
        found |= inner
    return found
