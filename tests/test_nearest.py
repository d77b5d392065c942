from hypothesis import given, settings
from hypothesis import strategies as st

from qpmpc.cycles.load import CYCLES
from qpmpc.nearest import LONGEST, nearest
from qpmpc.registry import controller_names
from qpmpc.vehicle.names import VEHICLES

NAMES = (*CYCLES.names(), *controller_names(), *VEHICLES.names())


@settings(max_examples=30, deadline=None)
@given(st.text(max_size=30))
def test_whatever_is_typed_only_an_allowed_name_is_suggested(text: str) -> None:
    assert nearest(text, NAMES) in ("", *NAMES)


@settings(deadline=None)
@given(st.sampled_from(NAMES), st.integers(0, 40), st.sampled_from("abcxyz-019"))
def test_one_wrong_letter_is_found(name: str, place: int, letter: str) -> None:
    """Of the longer names another may be as near: it differs by that letter too."""
    typed = name[: place % len(name)] + letter + name[place % len(name) + 1 :]
    found = nearest(typed, NAMES)
    if len(name) < 4:  # half of the letters are another's
        return
    assert found == name or (found and sum(a != b for a, b in zip(found, typed, strict=False)) <= 2)


def test_case_and_dashes_do_not_count() -> None:
    assert nearest("NYCC", NAMES) == "nycc"
    assert nearest("mh_qp", NAMES) == "mh-qp"
    assert nearest("travel-time", ["travel time"]) == "travel time"


def test_the_beginning_of_one_name_is_near() -> None:
    assert nearest("rule", NAMES) == "rule-based"
    assert nearest("xyz", NAMES) == ""


def test_of_an_endless_name_the_beginning_counts() -> None:
    assert nearest("x" * LONGEST + "y" * 1_000_000, ["x" * LONGEST]) == "x" * LONGEST
