"""The shipped files against the figures their publishers print."""

from decimal import Decimal
from importlib.resources import as_file, files

import numpy as np
import pytest
from pydantic import ValidationError

from qpmpc.cycles import CatalogueEntry, Figure, catalogue, cycle_names, load_cycle
from qpmpc.cycles.breakpoints import read_breakpoints

MPS_PER_MPH = 0.44704
published = [entry for entry in catalogue() if entry.published]


def test_names() -> None:
    assert set(cycle_names()) == {"nycc", "udds", "hwfet", "nedc", "nedc-truncated", "wltc-3b"}


def test_everyone_says_where_it_is_from() -> None:
    for entry in catalogue():
        assert entry.source
        assert entry.licence
        # only our own composition has no published statistics, and it says so
        assert entry.published or "Nobody publishes" in entry.note


@pytest.mark.parametrize("entry", published, ids=lambda entry: entry.name)
@pytest.mark.parametrize("quantity", ["duration", "distance", "speed_mean", "speed_max"])
def test_published_statistics(entry: CatalogueEntry, quantity: str) -> None:
    cycle = load_cycle(entry.name)
    ours = {
        "duration": cycle.duration_s,
        "distance": cycle.distance_m,
        "speed_mean": cycle.distance_m / cycle.duration_s,
        "speed_max": float(np.max(cycle.speed_mps)),
    }
    figure: Figure = getattr(entry.published, quantity)
    assert abs(ours[quantity] - figure.si) <= figure.rounding_si


@pytest.mark.parametrize(
    ("name", "tenth_mps"),
    [
        ("nycc", MPS_PER_MPH / 10),
        ("udds", MPS_PER_MPH / 10),
        ("hwfet", MPS_PER_MPH / 10),
        ("wltc-3b", 1 / 36),
    ],
)
def test_speeds_are_those_of_the_schedule(name: str, tenth_mps: float) -> None:
    """Schedules print tenths of mph (EPA) or of km/h (GTR 15); our files round to 1e-5 m/s."""
    tenths = load_cycle(name).speed_mps / tenth_mps
    np.testing.assert_allclose(tenths, np.round(tenths), atol=0.51e-5 / tenth_mps)


@pytest.mark.parametrize(
    ("part", "duration_s", "distance_m"), [("ECE15", 195, 1013), ("EUDC", 400, 6955)]
)
def test_parts_of_the_nedc(part: str, duration_s: float, distance_m: float) -> None:
    """R83's theoretical distances come from accelerations rounded to 0.01: allow 0.2 %."""
    with as_file(files("qpmpc.cycles") / "data/nedc_breakpoints.csv") as path:
        cycle = read_breakpoints(path, [part], name=part)
    assert cycle.duration_s == duration_s
    assert cycle.distance_m == pytest.approx(distance_m, rel=2e-3)


def test_nedc_accelerations_are_the_regulations() -> None:
    """R83: at most 1.04 m/s^2 (0 to 15 km/h in 4 s) and -1.39 m/s^2 (50 km/h to 0 in 10 s)."""
    accel = load_cycle("nedc").step_accel_mps2
    assert np.max(accel) == pytest.approx(15 / 3.6 / 4)
    assert np.min(accel) == pytest.approx(-50 / 3.6 / 10)


def test_truncated_nedc_is_made_of_the_nedc() -> None:
    nedc, truncated = load_cycle("nedc"), load_cycle("nedc-truncated")
    urban, highway = nedc.speed_mps[:195], nedc.speed_mps[4 * 195 :]
    expected = np.concatenate([urban, highway[:-1], nedc.speed_mps[:196]])
    np.testing.assert_allclose(truncated.speed_mps, expected, atol=1e-12)
    assert truncated.duration_s == 790
    # sum of its parts: 2 x ECE-15 less than the NEDC, which has 4
    urban_m = float(np.sum(nedc.step_speed_mps[:195]))
    assert truncated.distance_m == pytest.approx(nedc.distance_m - 2 * urban_m)


def test_figure_keeps_its_digits() -> None:
    figure = Figure.parse("11.0 km")
    assert figure.value == Decimal("11.0")
    assert figure.si == 11000
    assert figure.rounding_si == pytest.approx(50)
    assert str(figure) == "11.0 km"


@pytest.mark.parametrize("text", ["7.1", "7.1 furlong", "x mph", "7.1mph"])
def test_figure_refuses_other_text(text: str) -> None:
    with pytest.raises((ValueError, ArithmeticError)):
        Figure.parse(text)


def test_catalogue_refuses_unknown_keys() -> None:
    with pytest.raises(ValidationError, match="licnce"):
        CatalogueEntry.model_validate(
            {"name": "a", "title": "A", "data": "data/a.csv", "source": "s", "licnce": "l"}
        )
