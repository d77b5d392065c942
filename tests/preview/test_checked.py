"""A preview that is checked: a right one goes on from the one before, whatever the layout."""

import pytest

from qpmpc.cycles import load_cycle
from qpmpc.preview import HorizonSettings
from qpmpc.trip import Trip


@pytest.mark.parametrize("every_s", [1, 3])
@pytest.mark.parametrize(("short", "blocks"), [(20, 14), (1, 14), (1, 40), (3, 40)])
def test_no_right_preview_is_refused(short, blocks, every_s) -> None:
    """Short blocks change whole seconds of class where their bounds pass; so do missed messages."""
    trip = Trip(load_cycle("nycc"))
    preview = trip.preview(HorizonSettings(short_stages=short, blocks=blocks))
    refused = []
    for step in range(0, trip.steps, every_s):
        stages = preview.at(step)
        if preview.was_bad:
            refused.append(step)
        assert stages.duration_s.sum() > 0.0
    assert refused == []


def test_another_trip_is_refused_once() -> None:
    nycc, other = Trip(load_cycle("nycc")), Trip(load_cycle("udds"))
    layout = HorizonSettings()
    preview, told = nycc.preview(layout), other.preview(layout).source
    preview.at(0)
    preview.receive = told.preview
    preview.at(1)
    assert preview.was_bad
    preview.at(2)
    assert not preview.was_bad  # a new route is used from its second second on
