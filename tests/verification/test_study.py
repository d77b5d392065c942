"""The study of settings runs and judges honestly."""

import json

import pytest

from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import load_cycle
from qpmpc.vehicle import load_vehicle
from qpmpc.verification.study.__main__ import markdown
from qpmpc.verification.study.picture import draw_study
from qpmpc.verification.study.study import Place, judge
from qpmpc.verification.study.variants import Variant, variants


def test_every_variant_is_a_valid_setting():
    for variant in variants():
        overrides = {f"mh_qp.{key}": value for key, value in variant.overrides.items()}
        changed = ControllerSettings().with_settings(overrides)
        assert (changed == ControllerSettings()) == (variant.group == "default"), variant


def test_rows_tell_fuel_and_violations():
    place = Place(load_cycle("nycc"), load_vehicle(), dp_fuel_g=55.914)
    row = judge(Variant("default", "default"), [place])
    assert row["mean_percent"] == row["max_percent"] == pytest.approx(0.2, abs=0.3)
    assert row["violated"] == []
    poor = judge(Variant("iterations K", "3", {"admm.iterations": 3}), [place])
    assert poor["mean_percent"] > row["mean_percent"]
    assert json.dumps([row, poor])
    assert markdown([row, poor]).count("\n") == 4
    assert draw_study([row, poor]).startswith(b"\x89PNG")
