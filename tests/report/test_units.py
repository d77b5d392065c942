import numpy as np

from qpmpc.report.parameter_rows import parameter_rows
from qpmpc.report.units import unit_of
from qpmpc.vehicle import load_vehicle
from qpmpc.vehicle.engine_parameters import MAP

DIMENSIONLESS = {
    "rotating_mass_factor", "eta_drive", "eta_regen", "indicated_efficiency", "k", "exponent",
    "exhaust_share", "soc_grid", "soc_min", "soc_max", "soc_init", "soc_end",
    "soc_end_at_least", "eta_eq",
}  # fmt: skip


def test_every_parameter_has_a_unit_or_none_on_purpose():
    for section in load_vehicle().model_dump(exclude={"name", "description"}).values():
        for key in section:
            assert bool(unit_of(key)) != (key in DIMENSIONLESS), key


def test_longest_ending_counts():
    assert unit_of("ua1_w_per_k_per_mps") == "W/(K m/s)"
    assert unit_of("heat_capacity_j_per_k") == "J/K"
    assert unit_of("span_k") == "K"
    assert unit_of("ramp_w_per_s") == "W/s"
    assert unit_of("line_fuel_g_per_s") == "g/s"


def test_an_engine_of_two_hundred_points_is_a_row_among_others():
    """As wide as the widest other: its first values, its last and how many there are."""
    points = 200
    line = {
        "engine.line_power_w": np.linspace(0.0, 71e3, points).tolist(),
        "engine.line_fuel_g_per_s": np.linspace(0.1, 5.0, points).tolist(),
    } | dict.fromkeys(f"engine.{key}" for key in MAP)
    shown = {
        name: text for rows in parameter_rows(load_vehicle().with_settings(line))
        for name, text, _ in rows
    }  # fmt: skip
    assert shown["engine.line_power_w"].startswith("0 ")
    assert shown["engine.line_power_w"].endswith(f" ... 71000 ({points} values)")
    assert max(map(len, shown.values())) < 100
    assert shown["trip.soc_end_at_least"] == "false"
