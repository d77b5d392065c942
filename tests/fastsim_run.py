"""FASTSim's own run of a whole cycle, against which stepping is held; and what docs say of runs."""

import re
from pathlib import Path

import fastsim

from qpmpc.cycles import Cycle
from qpmpc.verification.fastsim.one_second import Model, departing, shipped_car, whole_road

PAGE = Path(__file__).parents[1] / "docs" / "fastsim.md"


def documented(model: Model) -> str:
    """The table of a car in docs/fastsim.md."""
    text = PAGE.read_text("utf-8")
    return text.partition(f"<!-- {model.plant}: ")[2].partition(f"<!-- end of {model.plant} -->")[0]


def documented_fuels(model: Model) -> list[tuple[str, str, str]]:
    """Cycle, controller and fuel of own control, rules and `mh-qp` there."""
    names = f"{model.plant}|rule-based|mh-qp"
    return re.findall(rf"^\| ([\w-]+) \| ({names}) \| ([\d.]+)", documented(model), re.M)


def whole_run(
    model: Model,
    cycle: Cycle,
    soc: float,
    t_cl_degc: float | None = None,
    t_amb_degc: float | None = None,
) -> dict:
    """The car at arrival, with the history of each second."""
    speed_mps = float(cycle.speed_mps[0])
    car = fastsim.Vehicle.from_dict(departing(shipped_car(model), soc, speed_mps, t_cl_degc))
    car.set_save_interval(1)
    allowed = {**fastsim.SimParams.default().to_dict(), "trace_miss_opts": "Allow"}
    road = fastsim.Cycle.from_dict(whole_road(cycle, t_amb_degc))
    drive = fastsim.SimDrive(car, road, fastsim.SimParams.from_dict(allowed))
    drive.run_once()
    return drive.to_dict()["veh"]
