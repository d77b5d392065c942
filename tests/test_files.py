"""Results are written whole or not at all."""

from pathlib import Path

import pytest

from qpmpc.errors import InputError
from qpmpc.files import check_file, check_folder, json_text, write_bytes, write_text


def test_write_makes_folders_and_leaves_nothing_else(tmp_path):
    file = tmp_path / "a" / "b" / "text.txt"
    write_text(file, "naïve\n")
    assert file.read_bytes() == "naïve\n".encode()
    assert list(file.parent.iterdir()) == [file]


def test_failed_write_keeps_the_old_file(tmp_path, monkeypatch):
    file = tmp_path / "text.txt"
    write_text(file, "old")

    def fails(path, content):
        with path.open("wb") as stream:
            stream.write(content[:1])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", fails)
    with pytest.raises(OSError, match="No space"):
        write_bytes(file, b"new")
    assert file.read_text() == "old"
    assert list(tmp_path.iterdir()) == [file]


def test_new_files_have_the_usual_permissions(tmp_path):
    write_text(tmp_path / "ours", "")
    (tmp_path / "usual").write_text("")
    assert (tmp_path / "ours").stat().st_mode == (tmp_path / "usual").stat().st_mode


def test_check_makes_nothing(tmp_path):
    check_folder(tmp_path / "a" / "b", "--out")
    check_file(tmp_path / "a" / "b.json", "--json")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("path", ["file", "file/below", "link", "link/below"])
def test_check_finds_what_is_in_the_way(tmp_path, path):
    (tmp_path / "file").touch()
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"--out .*(file|link)"):
        check_folder(tmp_path / path, "--out")


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
def test_json_refuses_what_is_no_number(value):
    with pytest.raises(ValueError, match="JSON"):
        json_text({"fuel_g": value})
