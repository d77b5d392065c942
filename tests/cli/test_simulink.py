"""``qpmpc simulink``: what it writes, and what it refuses."""

from pathlib import Path

import pytest


def test_a_controller_and_its_plant_are_written_and_named(cli, trip, tmp_path):
    for part, options in (
        ("controller", ("--controller", "mh-costate", "--precision", "f32")),
        ("plant", ("--part", "plant", "--vehicle", "prius-liion")),
    ):
        folder = tmp_path / f"my_{part}"
        done = cli("simulink", folder, "--cycle", trip, *options)
        assert (done.code, done.err) == (0, "")
        count = len(list(folder.iterdir()))
        assert done.out.startswith(
            f"{folder}: S-function my_{part}, steps of 1 s, {count} files written"
        )
        text = (folder / f"my_{part}.c").read_text("utf-8")
        assert f"\n#define S_FUNCTION_NAME my_{part}\n" in text
        assert "soc, single, 1. " in text if part == "controller" else "soc, double, 1. " in text
        assert "never run in Simulink" in (folder / "README.md").read_text("utf-8")
        assert (folder / "LICENSE.txt").exists()


def test_the_name_of_a_users_cycle_is_no_code(cli, trip, tmp_path):
    odd = tmp_path / "a*&'; b<i>.csv"
    odd.write_bytes(Path(trip).read_bytes())
    done = cli("simulink", tmp_path / "plant", "--part", "plant", "--cycle", odd)
    assert (done.code, done.err) == (0, "")
    texts = {path.name: path.read_text("utf-8") for path in (tmp_path / "plant").iterdir()}
    assert "a*&amp;&#x27;; b&lt;i&gt;" in texts.pop("README.md")
    assert not any("b<i>" in text or "a*&" in text for text in texts.values())


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["one"], "--part controller needs --cycle CYCLE, the trip that it previews"),
        (["my-car", "--cycle", "nycc"], "DIR my-car: the name must be a letter, then"),
        (["..", "--part", "plant"], "DIR ..: the name must be a letter, then"),
        (["there", "--part", "plant"], "DIR there: there is a file, not a directory"),
        (["a", "--part", "car"], "unknown part 'car': use one of controller, plant"),
        (["a", "--part", "plant", "--precision", "f32"], "--precision has no effect with"),
    ],
)
def test_what_cannot_be_is_one_line(cli, tmp_path, monkeypatch, arguments, line):
    monkeypatch.chdir(tmp_path)
    Path("there").write_text("")
    cli("simulink", *arguments).assert_refused(line)
    assert [path.name for path in tmp_path.iterdir()] == ["there"]
