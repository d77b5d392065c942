"""Sanity of the plant: the rules on EPA's cycles beside EPA's dynamometer figures.

Run it with ``python -m qpmpc.verification.epa``. EPA's figures are unadjusted miles per
gallon from its test-car list for the 2016 Prius; the plant was fitted to them with few free
numbers, so this shows that the structure is consistent; it is not an independent validation. Two
fits: with an engine that starts at no cost, `paper-nimh`, and with starts and all that makes a
winter, the default car.
"""

from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from rich.console import Console

from qpmpc.closed_loop import drive
from qpmpc.controllers.balance import rule_based
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.report.table import ShownTable
from qpmpc.trip import Trip
from qpmpc.vehicle import DEFAULT_VEHICLE, load_vehicle

M_PER_MILE = 1609.344
L_PER_GALLON = 3.785411784
TOLERANCE = 0.03  # of the model's own reference figures
AS_FITTED = "paper-nimh"
OFF_EPA = 0.05  # that we claim for the default car

# S EPA test-car list, 2016 Prius, cold-CO test: all three coefficients are 11.1 % higher
_COLD_ROAD = {"chassis.road_load_share_per_k": 0.00358}
_HOT = {"thermal.t_amb_degc": 24.0, "thermal.cabin_heat_w": 0.0, "thermal.t_cl_min_degc": -30.0}
_COLD = {
    **_COLD_ROAD,
    "thermal.t_amb_degc": -7.0,
    "thermal.t_cl_min_degc": -30.0,
    "battery.aux_power_w": 700.0,
    "thermal.cabin_heat_w": 3300.0,  # F heater power
    "thermal.cabin_heat_from_degc": 35.0,
    "thermal.cabin_heat_full_degc": 55.0,
}
# S EPA's schedule, 40 CFR Part 86, Appendix I; public domain in the United States
US06 = Path(str(resources.files("qpmpc.verification.epa"))) / "us06.csv"
_HOT_RULES: dict[str, object] = {"rule_based.heat_on_degc": 40.0, "rule_based.heat_off_degc": 45.0}
_COLD_RULES: dict[str, object] = {"rule_based.heat_on_degc": 60.0, "rule_based.heat_off_degc": 64.0}


def _from(t_cl_degc: float) -> dict[str, object]:
    return {"trip.t_cl_init_degc": t_cl_degc}


@dataclass(frozen=True)
class EpaCase:
    """One dynamometer test.

    Attributes
    ----------
    epa_mpg : measured by EPA
    reference_mpg : result of this plant's equations when its free numbers were fitted
    vehicle, rules : overrides
    """

    name: str
    cycle: str
    epa_mpg: float
    reference_mpg: float
    vehicle: dict[str, object]
    rules: dict[str, object]


# The radiator of the paper's car is too weak for it by 10 K of coolant.
_US06 = {**_HOT, **_from(88.0), "thermal.radiator_w_per_k": 900.0}

CASES = (
    EpaCase("UDDS hot", "udds", 82.0, 79.4, {**_HOT, **_from(88.0)}, _HOT_RULES),
    EpaCase("HWFET hot", "hwfet", 71.2, 72.7, {**_HOT, **_from(88.0)}, _HOT_RULES),
    EpaCase("US06 hot, radiator", str(US06), 48.6, 50.0, _US06, _HOT_RULES),
    EpaCase("UDDS cold, 24 C", "udds", 73.7, 70.3, {**_HOT, **_from(24.0)}, _HOT_RULES),
    EpaCase("UDDS cold, -7 C", "udds", 46.4, 45.5, {**_COLD, **_from(-7.0)}, _COLD_RULES),
    EpaCase("UDDS warm, -7 C", "udds", 58.4, 58.3, {**_COLD, **_from(60.0)}, _COLD_RULES),
)


def model_mpg(case: EpaCase, vehicle_name: str = AS_FITTED) -> float:
    """Unadjusted, SOC-balanced miles per gallon of a car in one case."""
    vehicle = load_vehicle(vehicle_name).with_settings(case.vehicle)
    settings = ControllerSettings().with_settings(case.rules)
    trip = Trip(case.cycle, vehicle)
    run = drive(trip, rule_based(trip, settings))
    litres = run.fuel_soc_balanced_g / 1e3 / vehicle.engine.density_kg_per_l
    return run.distance_km * 1e3 / M_PER_MILE / (litres / L_PER_GALLON)


def main() -> int:
    """Print the table; the exit code is 1 if a figure is further off than it should be.

    3 % from the reference of the first fit, 5 % from EPA with the second.
    """
    table = ShownTable(title="Rule-based, unadjusted mpg")
    as_fitted = ("as fitted", "off reference", "off EPA")
    for column in ("case", "EPA", *as_fitted, DEFAULT_VEHICLE, "off EPA"):
        table.add_column(column, justify="left" if column == "case" else "right")
    worst = furthest = 0.0
    for case in CASES:
        mpg = model_mpg(case)
        off = mpg / case.reference_mpg - 1.0
        worst = max(worst, abs(off))
        of_default = model_mpg(case, DEFAULT_VEHICLE)
        furthest = max(furthest, abs(of_default / case.epa_mpg - 1.0))
        table.add_row(
            case.name,
            f"{case.epa_mpg:.1f}",
            f"{mpg:.1f}",
            f"{off:+.1%}",
            f"{mpg / case.epa_mpg - 1.0:+.1%}",
            f"{of_default:.1f}",
            f"{of_default / case.epa_mpg - 1.0:+.1%}",
        )
    Console().print(table)
    return 0 if worst <= TOLERANCE and furthest <= OFF_EPA else 1
