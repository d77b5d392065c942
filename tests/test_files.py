"""Results are written whole or not at all."""

import json
import os
import threading
from pathlib import Path

import pytest
from hostile import limited_disk

from qpmpc.errors import InputError, QpmpcError
from qpmpc.files import check_file, check_folder, json_text, write_bytes, write_text


def test_write_makes_folders_and_leaves_nothing_else(tmp_path):
    file = tmp_path / "a" / "b" / "text.txt"
    write_text(file, "naïve\n")
    assert file.read_bytes() == "naïve\n".encode()
    assert list(file.parent.iterdir()) == [file]


def test_failed_write_keeps_the_old_file_and_names_it(tmp_path):
    file = tmp_path / "text.txt"
    write_text(file, "old")
    with limited_disk(1000), pytest.raises(OSError, match="too large") as failed:
        write_bytes(file, bytes(5000))
    assert failed.value.filename == str(file)
    assert file.read_text() == "old"
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("mask", [0o022, 0o077, 0o002])
def test_new_files_have_the_usual_permissions(tmp_path, mask):
    before = os.umask(mask)
    try:
        write_text(tmp_path / "ours", "")
        (tmp_path / "usual").write_text("")
    finally:
        os.umask(before)
    assert (tmp_path / "ours").stat().st_mode == (tmp_path / "usual").stat().st_mode


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o666])
def test_a_file_that_is_written_again_keeps_its_permissions(tmp_path, mode):
    file = tmp_path / "text.txt"
    file.write_text("old")
    file.chmod(mode)
    write_text(file, "new")
    assert (file.read_text(), file.stat().st_mode & 0o777) == ("new", mode)


def test_readers_see_the_old_file_or_all_of_the_new(tmp_path):
    file = tmp_path / "text.txt"
    file.write_text("old")
    with file.open() as reader:
        write_text(file, "new and longer")
        assert reader.read() == "old"
    assert file.read_text() == "new and longer"


@pytest.mark.parametrize("there", [True, False])
def test_a_link_stays_and_its_target_is_written(tmp_path, there):
    (tmp_path / "elsewhere").mkdir()
    target = tmp_path / "elsewhere" / "target.txt"
    if there:
        target.write_text("old")
        target.chmod(0o640)
    (tmp_path / "second").symlink_to("elsewhere/target.txt")
    link = tmp_path / "link.txt"
    link.symlink_to("second")
    check_file(link, "--json")
    write_text(link, "new")
    assert link.is_symlink()
    assert target.read_text() == "new"
    assert list(target.parent.iterdir()) == [target]
    assert not there or target.stat().st_mode & 0o777 == 0o640


def test_a_link_to_a_file_is_replaced_in_one_step_too(tmp_path):
    (tmp_path / "target").write_text("old")
    (tmp_path / "link").symlink_to("target")
    with limited_disk(1000), pytest.raises(OSError, match="too large"):
        write_bytes(tmp_path / "link", bytes(5000))
    assert (tmp_path / "target").read_text() == "old"


def test_both_names_of_a_file_stay_names_of_it(tmp_path):
    (tmp_path / "one").write_text("old and longer")
    (tmp_path / "other").hardlink_to(tmp_path / "one")
    write_text(tmp_path / "one", "new")
    assert (tmp_path / "other").read_text() == "new"


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files away")
def test_a_file_of_another_owner_stays_theirs(tmp_path):
    file = tmp_path / "file"
    file.write_text("old and longer")
    os.chown(file, 12345, 12345)
    write_text(file, "new")
    assert (file.read_text(), file.stat().st_uid, file.stat().st_gid) == ("new", 12345, 12345)


@pytest.mark.parametrize("through_a_link", [False, True])
def test_a_fifo_gets_the_content_and_stays(tmp_path, through_a_link):
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    file = fifo
    if through_a_link:
        file = tmp_path / "link"
        file.symlink_to("fifo")
    check_file(file, "--json")  # which must not wait for a reader
    read: list[bytes] = []
    reader = threading.Thread(target=lambda: read.append(fifo.read_bytes()))
    reader.start()
    write_bytes(file, bytes(200_000))  # more than a pipe holds
    reader.join(timeout=10)
    assert read == [bytes(200_000)]
    assert fifo.is_fifo()
    assert file.is_symlink() == through_a_link


def test_a_reader_that_leaves_a_fifo_early_is_said(tmp_path):
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)

    def leave():
        with fifo.open("rb") as stream:
            stream.read(1)

    reader = threading.Thread(target=leave)
    reader.start()
    with pytest.raises(QpmpcError, match="fifo: the reader left"):
        write_bytes(fifo, bytes(2_000_000))
    reader.join(timeout=10)


def test_a_device_is_written_to_and_its_error_is_that_of_the_file(tmp_path):
    for name in ("null", "full"):
        (tmp_path / name).symlink_to(f"/dev/{name}")
        check_file(tmp_path / name, "--json")
    write_text(tmp_path / "null", "gone")
    assert (tmp_path / "null").is_char_device()
    with pytest.raises(OSError, match=r"No space left.*tmp.*full"):
        write_text(tmp_path / "full", "x")
    assert (tmp_path / "full").readlink().is_char_device()


def test_an_open_descriptor_is_written_where_it_stands(tmp_path):
    with (tmp_path / "log").open("w") as log:
        log.write("before ")
        log.flush()
        write_text(Path(f"/dev/fd/{log.fileno()}"), "ours")
        log.write(" after")
    assert (tmp_path / "log").read_text() == "before ours after"


def test_a_planted_temporary_is_not_followed(tmp_path):
    victim = tmp_path / "victim"
    victim.write_text("precious")
    file = tmp_path / "run.json"
    # the name that the temporary file had once: it could be guessed
    (tmp_path / f".{file.name}.{os.getpid()}.tmp").symlink_to(victim)
    write_text(file, "new")
    assert victim.read_text() == "precious"
    assert file.read_text() == "new"
    assert not file.is_symlink()


def test_a_temporary_planted_by_one_who_guesses_its_name_is_not_opened(tmp_path, monkeypatch):
    guess = iter(["00" * 8, "11" * 8])
    monkeypatch.setattr("secrets.token_hex", lambda _: next(guess))
    victim, planted = tmp_path / "victim", tmp_path / f".{'00' * 8}.tmp"
    planted.symlink_to(victim)  # dangling: creating would follow it
    with pytest.raises(FileExistsError):
        write_text(tmp_path / "run.json", "new")
    assert planted.is_symlink()
    assert not victim.exists()
    write_text(tmp_path / "run.json", "new")
    assert (tmp_path / "run.json").read_text() == "new"


def test_a_name_as_long_as_the_file_system_allows(tmp_path):
    file = tmp_path / ("x" * 250 + ".json")
    write_text(file, "new")
    assert file.read_text() == "new"


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


def test_check_finds_a_link_that_leads_into_no_folder(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "nowhere" / "file")
    with pytest.raises(InputError, match=r"--json .*link.*nowhere"):
        check_file(tmp_path / "link", "--json")
    (tmp_path / "circle").symlink_to(tmp_path / "circle")
    with pytest.raises(InputError, match=r"--json .*circle"):
        check_file(tmp_path / "circle", "--json")
    with pytest.raises(InputError, match=r"--json .*too long"):
        check_file(tmp_path / ("x" * 300), "--json")


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
def test_json_refuses_what_is_no_number(value):
    with pytest.raises(ValueError, match="JSON"):
        json_text({"fuel_g": value})


def test_json_escapes_what_a_terminal_would_obey_and_stays_the_same_data():
    data = {"cycle": "a\x1b[31m\x9b1m\u202e\n\x7f\udcff\U000e0001 \u00a0ü\U0001f697"}
    text = json_text(data)
    assert json.loads(text) == data
    assert "ü" in text
    assert all(c.isprintable() or c in "\n\u00a0" for c in text)
