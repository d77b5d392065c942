from qpmpc.report.units import unit_of
from qpmpc.vehicle import load_vehicle

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
