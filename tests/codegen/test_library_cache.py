"""What is kept on disk is loaded only if it is ours and as it was stored."""

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from qpmpc import remarks
from qpmpc.codegen import library_cache
from qpmpc.codegen.c_compiler import CodegenError, compiler
from qpmpc.codegen.host_library import HostLibrary, compiled
from qpmpc.codegen.library_cache import Kept, kept_file
from qpmpc.codegen.values import values_of
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle
from qpmpc.simulation import simulate
from qpmpc.vehicle import load_vehicle

KEY, CONTENT = "0" * 24, b"what the compiler made"
needs_root = pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files away")
needs_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler on this machine")
C = {"one.c": "int one(void) { return 1; }\n"}


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """Where the cache will be; not made yet."""
    monkeypatch.setenv("QPMPC_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache" / "compiled"


def made_once() -> bytes:
    return CONTENT


def not_made() -> bytes:
    raise AssertionError("it is there already")


def is_private(kept: Kept) -> bool:
    """Whether it is in the temporary folder of this process."""
    place = kept.file.parent
    return place.name.startswith("qpmpc-") and place.stat().st_mode & 0o777 == 0o700


def test_a_library_is_made_once_and_nobody_else_can_write_it(folder):
    file, remark = kept_file(KEY, ".so", made_once)
    assert remark == ""
    assert file.read_bytes() == CONTENT
    assert list(folder.iterdir()) == [file]
    assert folder.stat().st_mode & 0o777 == 0o700
    assert file.stat().st_mode & 0o777 == 0o600
    assert kept_file(KEY, ".so", not_made).file == file


def truncated(file: Path) -> None:
    file.write_bytes(CONTENT[:5])


def emptied(file: Path) -> None:
    file.write_bytes(b"")


def altered(file: Path) -> None:
    file.write_bytes(CONTENT.replace(b"made", b"MADE"))


def link(file: Path) -> None:
    file.rename(file.parent.parent / "same")  # the content is right, and could change any time
    file.symlink_to(file.parent.parent / "same")


def writable(file: Path) -> None:
    file.chmod(0o666)


def fifo(file: Path) -> None:
    file.unlink()
    os.mkfifo(file)


@pytest.mark.parametrize("spoil", [truncated, emptied, altered, link, writable, fifo])
def test_what_is_not_as_it_was_stored_is_made_again(folder, spoil):
    file = kept_file(KEY, ".so", made_once).file
    spoil(file)
    assert kept_file(KEY, ".so", made_once) == Kept(file)
    assert file.read_bytes() == CONTENT
    assert file.is_file()
    assert not file.is_symlink()
    assert file.stat().st_mode & 0o777 == 0o600


def test_a_library_with_a_second_name_is_made_again(folder, tmp_path):
    file = kept_file(KEY, ".so", made_once).file
    (tmp_path / "second").hardlink_to(file)
    assert kept_file(KEY, ".so", made_once) == Kept(file)
    assert file.stat().st_nlink == 1


def test_an_empty_file_whose_name_has_the_hash_of_nothing_is_not_taken(folder):
    file = kept_file(KEY, ".so", made_once).file
    file.rename(file.with_name(library_cache._name(KEY, ".so", b"")))
    file.with_name(library_cache._name(KEY, ".so", b"")).write_bytes(b"")
    assert kept_file(KEY, ".so", made_once) == Kept(file)


@needs_root
def test_a_library_of_another_owner_is_made_again(folder):
    file = kept_file(KEY, ".so", made_once).file
    os.chown(file, 12345, -1)
    assert kept_file(KEY, ".so", made_once) == Kept(file)
    assert file.stat().st_uid == os.geteuid()


@pytest.mark.parametrize("mode", [0o770, 0o707, 0o777, 0o1777])
def test_a_folder_that_others_may_write_to_is_not_used(folder, mode):
    folder.mkdir(parents=True)
    folder.chmod(mode)
    kept = kept_file(KEY, ".so", made_once)
    assert is_private(kept)
    assert str(folder) in kept.remark
    assert f"others may write to it (mode {mode:o}" in kept.remark
    assert "\n" not in kept.remark
    assert list(folder.iterdir()) == []
    assert kept_file(KEY, ".so", not_made) == kept  # made once a process all the same


def test_a_folder_that_is_a_link_is_not_used(folder, tmp_path):
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    folder.parent.mkdir()
    folder.symlink_to(tmp_path / "elsewhere")
    kept = kept_file(KEY, ".so", made_once)
    assert is_private(kept)
    assert "link" in kept.remark
    assert list((tmp_path / "elsewhere").iterdir()) == []


@needs_root
@pytest.mark.parametrize("whose", ["", ".."])
def test_a_folder_in_the_hands_of_another_is_not_used(folder, whose):
    folder.mkdir(parents=True, mode=0o700)
    os.chown(folder / whose, 12345, -1)
    kept = kept_file(KEY, ".so", made_once)
    assert is_private(kept)
    assert "belongs to user 12345" in kept.remark


def test_a_folder_that_others_could_rename_is_not_used_unless_its_parent_is_sticky(folder):
    folder.parent.mkdir()
    folder.parent.chmod(0o777)
    kept = kept_file(KEY, ".so", made_once)
    assert is_private(kept)
    assert f"others may write to {folder.parent}" in kept.remark
    folder.parent.chmod(0o1777)  # as /tmp is
    assert kept_file(KEY, ".so", made_once).file.parent == folder


def test_links_above_the_folder_are_followed_once(folder, tmp_path):
    """As where a home is on another disk; the library is then loaded by its real path."""
    (tmp_path / "disk").mkdir()
    folder.parent.symlink_to(tmp_path / "disk")
    assert kept_file(KEY, ".so", made_once).file.parent == tmp_path / "disk" / "compiled"


def test_a_folder_that_cannot_be_made_is_named_with_the_reason(folder):
    folder.parent.write_text("a file")
    kept = kept_file(KEY, ".so", made_once)
    assert is_private(kept)
    assert str(folder) in kept.remark
    assert kept.remark.endswith("exists") or "ot a directory" in kept.remark


def test_a_disk_that_is_full_is_named_and_leaves_nothing(folder, monkeypatch, tmp_path):
    def full(file, *_, **__):
        if file.parent == folder:
            raise OSError(28, "No space left on device", str(file))
        return whole(file, *_, **__)

    whole = library_cache.replace_file
    monkeypatch.setattr(library_cache, "replace_file", full)
    made = []
    kept = kept_file(KEY, ".so", lambda: made.append(1) or CONTENT)
    assert is_private(kept)
    assert kept.remark.endswith(f"{folder}: No space left on device")
    assert len(made) == 1  # not compiled again for the other place


def test_default_place_and_what_a_relative_one_means(tmp_path, monkeypatch):
    monkeypatch.delenv("QPMPC_CACHE_DIR", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")  # not allowed, therefore ignored
    assert library_cache._folder() == tmp_path / "home" / ".cache" / "qpmpc-iptm"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert library_cache._folder() == tmp_path / "xdg" / "qpmpc-iptm"
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("QPMPC_CACHE_DIR", "here")
    assert library_cache._folder() == tmp_path / "here" / "compiled"


def test_the_cache_is_bounded_and_forgets_what_was_not_used_for_longest(folder, monkeypatch):
    monkeypatch.setattr(library_cache, "MOST_BYTES", 5 * len(CONTENT))
    files = {}
    for i in range(5):
        key = f"{i:024}"
        files[i] = kept_file(key, ".so", made_once).file
        hour_ago = time.time() - 3600 + i
        os.utime(files[i], (hour_ago, hour_ago))
    left_over = folder / ".0123456789abcdef.tmp"  # of a process that was killed
    left_over.write_bytes(CONTENT)
    os.utime(left_over, (1.0, 1.0))
    assert kept_file(f"{0:024}", ".so", not_made).file == files[0]  # the oldest, used again
    newest = kept_file(KEY[:-1] + "9", ".so", made_once).file
    assert set(folder.iterdir()) == {newest, files[0], files[2], files[3], files[4]}


def test_a_library_in_use_is_not_forgotten_however_full_the_cache(folder, monkeypatch):
    monkeypatch.setattr(library_cache, "MOST_BYTES", 1)
    files = {kept_file(f"{i:024}", ".so", made_once).file for i in range(3)}
    assert set(folder.iterdir()) == files  # each may be about to be loaded


def test_processes_that_make_the_same_at_once_all_get_it_whole(folder):
    code = (
        "import os, sys\n"
        "from qpmpc.codegen.library_cache import kept_file\n"
        "for i in range(30):\n"
        "    content = bytes([i]) * 100_000\n"
        "    file, remark = kept_file(f'{i:024}', '.so', lambda: content)\n"
        "    assert not remark and file.read_bytes() == content\n"
    )
    running = [subprocess.Popen([sys.executable, "-c", code]) for _ in range(4)]
    assert [process.wait(timeout=60) for process in running] == [0, 0, 0, 0]
    assert len(list(folder.iterdir())) == 30


def test_the_temporary_folder_goes_with_its_process_and_not_with_a_fork(folder, tmp_path):
    folder.parent.write_text("a file")  # so that nothing can be kept
    (tmp_path / "temporary").mkdir()
    code = (
        "import os, sys\n"
        "from qpmpc.codegen.library_cache import kept_file\n"
        "file, remark = kept_file('0' * 24, '.so', lambda: b'content')\n"
        "child = os.fork()\n"
        "if child == 0:\n"
        "    other = kept_file('0' * 24, '.so', lambda: b'content').file\n"
        "    assert other.exists() and other.parent != file.parent\n"
        "    sys.exit()\n"  # runs what is registered for the end
        "assert os.waitpid(child, 0)[1] == 0\n"
        "assert file.exists()\n"
        "print(file)\n"
    )
    environment = os.environ | {"TMPDIR": str(tmp_path / "temporary")}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert str(tmp_path / "temporary") in done.stdout
    assert list((tmp_path / "temporary").iterdir()) == []


@needs_compiler
def test_another_compiler_under_the_same_name_builds_again(folder, tmp_path, monkeypatch):
    wrapper, real = tmp_path / "cc", compiler()

    def with_version(number: int) -> Path:
        wrapper.write_text(f'#!/bin/sh\n# {number}\nexec {real} "$@"\n')
        wrapper.chmod(0o755)
        os.utime(wrapper, (number, number))
        return compiled(C)

    monkeypatch.setenv("CC", str(wrapper))
    names = [with_version(1).name, with_version(1).name, with_version(2).name]
    keys = [name.partition("-")[0] for name in names]
    assert keys[0] == keys[1] != keys[2]
    assert len(list(folder.iterdir())) == 2


@needs_compiler
def test_a_library_that_is_no_controller_is_one_line(folder, tmp_path):
    settings = ControllerSettings()
    values = values_of(load_vehicle(), settings.mh_qp, settings.rule_based)
    for content in (b"", b"no library", compiled(C).read_bytes()):
        (tmp_path / "lib.so").write_bytes(content)
        with pytest.raises(CodegenError, match=r"lib\.so cannot be loaded"):
            HostLibrary(tmp_path / "lib.so", values, "f64")


@needs_compiler
def test_a_compiler_that_is_no_program_is_one_line(folder, tmp_path, monkeypatch):
    (tmp_path / "cc").write_bytes(b"\x7fELF but no more")
    (tmp_path / "cc").chmod(0o755)
    monkeypatch.setenv("CC", str(tmp_path / "cc"))
    with pytest.raises(CodegenError, match="implementation=python needs none"):
        compiled(C)


@needs_compiler
def test_a_run_says_which_folder_cannot_be_used_and_why(folder, caplog):
    folder.mkdir(parents=True)
    folder.chmod(0o777)
    remarks.say_once.cache_clear()
    speed_mps = np.concatenate([np.linspace(0.0, 10.0, 10), np.full(10, 10.0)])
    run = simulate(Cycle("short", np.arange(20.0), speed_mps, np.zeros(20)), "mh-qp")
    assert run.summary()["solver"]["implementation"] == "c"  # all the same
    _of_the_battery, remark = run.remarks
    assert str(folder) in remark
    assert "mode 777" in remark
    assert [record.getMessage() for record in caplog.records] == [remark]
