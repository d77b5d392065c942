"""Files of faults: what is allowed, and one line for what is not."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from qpmpc.errors import InputError
from qpmpc.faults.kinds import KINDS, SIGNALS
from qpmpc.faults.models import Fault, as_faults, load_faults

GOOD = '[[fault]]\nkind = "offset"\nsignal = "soc"\nat_s = 100\nfor_s = 3\nvalue = 0.05\n'


def written(folder: Path, text: str) -> Path:
    file = folder / "faults.toml"
    file.write_text(text)
    return file


def test_a_good_file(tmp_path):
    two = GOOD + '[[fault]]\nkind = "reset"\nat_s = 7\n'
    offset, reset = load_faults(written(tmp_path, two))
    assert offset == Fault(kind="offset", signal="soc", at_s=100, for_s=3, value=0.05)
    assert (reset.for_s, reset.what) == (1, "reset")  # one reset unless more are asked for
    assert [t for t in range(120) if offset.holds(t)] == [100, 101, 102]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"offset"', '"ofset"', ["fault 1", "kind", "'offset'", "'late'"]),
        ('"soc"', '"soq"', ["fault 1", "signal", "'soc'", "'second'"]),
        ('kind = "offset"\n', "", ["fault 1", "missing kind"]),
        ("at_s", "at", ["unknown at", "at_s"]),
        ("100", "-1", ["at_s", "greater than or equal to 0"]),
        ("100", "1.5", ["at_s", "integer"]),
        ("100", "true", ["at_s", "integer"]),
        ("100", "99999999999", ["at_s", "1000000"]),
        ("for_s = 3", "for_s = 0", ["for_s", "greater than or equal to 1"]),
        ("0.05", "nan", ["value", "finite"]),
        ("0.05", "1e300", ["value", "1000000000"]),
        ("0.05", '"0.05"', ["value", "number"]),
        ("value = 0.05", "", ["value is missing", "offset"]),
        ('signal = "soc"\n', "", ["signal of kind offset", "soc, t_cl_degc"]),
        ('"soc"', '"engine_on"', ["signal of kind offset", "soc, t_cl_degc"]),
        ('"soc"', '"second"', ["signal second", "whole seconds"]),
        ('"offset"', '"stuck"', ["value must be left out"]),
        ('"offset"', '"wild"', ["signal must be left out"]),
        ('"offset"', '"delay"', ["delay", "whole seconds, 1 or more"]),
        ('kind = "offset"\nsignal = "soc"', 'kind = "jump"\nsignal = "engine_on"', ["0 or 1"]),
        ("[[fault]]", "[fault]", ["[[fault]]"]),
        ("[[fault]]", "[[faults]]", ["[[fault]]"]),
        ("[[fault]]", "x = 1\n[[fault]]", ["[[fault]]"]),
        (GOOD, "", ["[[fault]]"]),
        (GOOD, "fault = []", ["0 faults", "1 to 1000"]),
        (GOOD, "fault = [1]", ["fault 1", "table"]),
        (GOOD, GOOD * 1001, ["1001 faults"]),
        (GOOD, "#" * 1_000_001, ["larger than"]),
        (GOOD, "[[fault]", ["not valid TOML"]),
    ],
)
def test_a_bad_file_is_met_with_one_line(tmp_path, old, new, words):
    text = GOOD.replace(old, new, 1)
    assert text != GOOD
    with pytest.raises(InputError) as error:
        load_faults(written(tmp_path, text))
    for word in ["faults.toml", *words]:
        assert word in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("path", ["missing.toml", ".", "null\0.toml"])
def test_a_file_that_cannot_be_read(tmp_path, path):
    with pytest.raises(InputError, match="faults file"):
        load_faults(f"{tmp_path}/{path}")


def test_bytes_that_are_no_text(tmp_path):
    (tmp_path / "faults.toml").write_bytes(b"\xff\xfe[[fault]]")
    with pytest.raises(InputError, match="UTF-8"):
        load_faults(tmp_path / "faults.toml")


def test_faults_from_python_are_checked_alike():
    assert as_faults([{"kind": "wild", "at_s": 3}])[0].kind == "wild"
    with pytest.raises(InputError, match="fault 2: missing at_s"):
        as_faults([{"kind": "wild", "at_s": 3}, {"kind": "wild"}])
    with pytest.raises(InputError, match="list of faults"):
        as_faults(3)


VALUES = st.one_of(st.none(), st.floats(), st.integers(), st.just("soc"), st.booleans())
KEYS = st.sampled_from(["kind", "signal", "at_s", "for_s", "value", "more"])


@given(
    st.dictionaries(KEYS, VALUES, max_size=2),
    st.sampled_from([*KINDS]),
    st.sampled_from([*SIGNALS, None]),
)
def test_any_table_is_a_fault_or_an_input_error(table, kind, signal):
    try:
        (fault,) = as_faults([{"kind": kind, "signal": signal, "at_s": 1, **table}])
    except InputError:
        return
    assert (fault.value is None) == (not KINDS[fault.kind].value)


def test_the_page_has_every_kind_and_says_what_it_does():
    page = (Path(__file__).parents[2] / "docs" / "faults.md").read_text("utf-8")
    for name, kind in KINDS.items():
        assert f"| `{name}` | {kind.text} |" in page
