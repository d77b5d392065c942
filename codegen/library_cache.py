"""Compiled libraries and objects kept on disk, in a folder that nobody else can write to.

A file's name holds the key of what it was made from and the SHA-256 of its content. It is loaded or
linked only if that is still its content. Between this check and its use nobody can change it,
because the folder is private: that is checked before each use, up to the root of the file system.
Where no such folder can be had, a temporary one of this process takes its place. Of processes that
want the same file at once, one makes it and the others wait, for a limited time.
"""

import atexit
import logging
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from fcntl import LOCK_EX, LOCK_NB, LOCK_SH, flock
from functools import cache
from grp import getgrgid
from hashlib import sha256
from pathlib import Path
from pwd import getpwuid
from stat import S_IMODE, S_ISDIR, S_ISREG, S_ISVTX, S_IWGRP, S_IWOTH
from typing import NamedTuple

from qpmpc.files import replace_file

MOST_BYTES = 64 * 2**20  # of all files together; a library or object has about 80 KiB
IN_USE_S = 60.0  # a file used in this time may be about to be loaded: it is not deleted
# for another process that makes the same; a library waits for its object too: twice this at most
LONGEST_WAIT_S = 30.0
POLL_S = 0.01
_log = logging.getLogger(__name__)
_OTHERS_WRITE = S_IWGRP | S_IWOTH


class Kept(NamedTuple):
    """A file that may be loaded or linked.

    Attributes
    ----------
    file : of the library or object
    remark : the folder in which it cannot be kept and why, in one line; empty if it is kept
    """

    file: Path
    remark: str = ""


def kept_file(key: str, suffix: str, build: Callable[[], bytes]) -> Kept:
    """Return the file of a key, built if it is not there or is not what was stored.

    Parameters
    ----------
    key : hash of all that the file is made from
    suffix : of its name, `.so` or `.o`
    build : makes its content

    Raises
    ------
    OSError
        If there is not even a temporary folder.
    """
    content = b""
    folder = _folder()
    try:
        fault = _fault(folder)
        if not fault:
            if found := _whole(folder, key, suffix):
                _log.info("compiled controller kept in %s", found)
                return Kept(found)
            with _alone(folder, key):
                if found := _whole(folder, key, suffix):  # made while this process waited
                    return Kept(found)
                _log.info("nothing in %s for %s%s: compiled now", folder, key, suffix)
                content = build()
                return Kept(_stored(folder, key, suffix, content))
    except OSError as error:
        fault = str(error.strerror)
    private = _private_folder(os.getpid())
    found = _whole(private, key, suffix)
    file = found or _stored(private, key, suffix, content or build())
    return Kept(file, f"compiled controllers are not kept for the next run: {folder}: {fault}")


def folder_and_fault() -> tuple[Path, str]:
    """Return the folder of this cache, made if need be, and why it cannot be used, if so."""
    folder = _folder()
    try:
        return folder, _fault(folder)
    except OSError as error:
        return folder, str(error.strerror)


def _folder() -> Path:
    """Return the folder that the environment names, its parents free of links."""
    chosen = os.environ.get("QPMPC_CACHE_DIR")
    if chosen:
        folder = Path(chosen).absolute() / "compiled"
    else:
        base = os.environ.get("XDG_CACHE_HOME", "")
        if not base.startswith("/"):  # as XDG's specification has it
            base = os.path.expanduser("~/.cache")  # noqa: PTH111 - does not raise
        folder = Path(base) / "qpmpc-iptm"
    return Path(os.path.realpath(folder.parent)) / folder.name if folder.is_absolute() else folder


def _fault(folder: Path) -> str:
    """Make the folder if it is not there; return why it cannot be used, empty if it can.

    Raises
    ------
    OSError
        If it cannot be made or examined.
    """
    if not folder.is_absolute():
        return "there is no home folder (QPMPC_CACHE_DIR names another)"
    folder.parent.mkdir(parents=True, exist_ok=True)
    with suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    found, own = folder.lstat(), os.geteuid()
    if not S_ISDIR(found.st_mode):
        return "is a link or a file, not a folder"
    if found.st_uid != own:
        return f"belongs to {_user(found.st_uid)}"
    if found.st_mode & _OTHERS_WRITE:
        return f"others may write to it (mode {S_IMODE(found.st_mode):o}; chmod 700 mends it)"
    for parent in folder.parents:
        above = parent.stat()
        if above.st_uid not in (0, own):
            return f"{parent} belongs to {_user(above.st_uid)}"
        # in a folder that is sticky, as /tmp is, nobody else can rename what is ours
        sticky = above.st_mode & S_ISVTX
        if above.st_mode & _OTHERS_WRITE and not sticky and not _for_us_alone(above):
            return f"others may write to {parent}"
    if os.statvfs(folder).f_flag & getattr(os, "ST_NOEXEC", 0):
        return "is on a file system mounted noexec"
    return ""


def _user(number: int) -> str:
    with suppress(KeyError):
        return f"user {getpwuid(number).pw_name}"
    return f"user {number}"


def _for_us_alone(folder: os.stat_result) -> bool:
    """Whether those who may write are the user's private group, usual with a umask of 002."""
    with suppress(KeyError):
        own = getpwuid(os.geteuid()).pw_name
        group = getgrgid(folder.st_gid)
        alone = group.gr_name == own and set(group.gr_mem) <= {own}
        return alone and not folder.st_mode & S_IWOTH
    return False


@cache
def _private_folder(process: int) -> Path:
    """Make a folder that goes when this process ends."""
    folder = Path(tempfile.mkdtemp(prefix="qpmpc-"))

    def remove() -> None:
        if os.getpid() == process:  # a fork ends as well, and this is not its own
            shutil.rmtree(folder, ignore_errors=True)

    atexit.register(remove)
    return folder


def _whole(folder: Path, key: str, suffix: str) -> Path | None:
    """Return the file if it is as it was stored; whatever else has its name is removed."""
    with _locked(folder, LOCK_SH):
        for file in folder.glob(f"{key}-*{suffix}"):
            with suppress(OSError):
                content = _content(file)
                if content and file.name == _name(key, suffix, content):
                    os.utime(file)  # the last to be deleted
                    return file
                file.unlink()
    return None


def _content(file: Path) -> bytes:
    """Return the content of a file of ours, and of nobody else; empty for anything else."""
    try:
        handle = os.open(file, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError:
        return b""
    with open(handle, "rb") as stream:  # noqa: PTH123
        found = os.fstat(handle)
        ours = S_ISREG(found.st_mode) and found.st_uid == os.geteuid() and found.st_nlink == 1
        return stream.read() if ours and not found.st_mode & _OTHERS_WRITE else b""


def _name(key: str, suffix: str, content: bytes) -> str:
    return f"{key}-{sha256(content).hexdigest()}{suffix}"


def _stored(folder: Path, key: str, suffix: str, content: bytes) -> Path:
    file = folder / _name(key, suffix, content)
    replace_file(file, content, mode=0o600)
    _bound(folder, file)
    return file


def _bound(folder: Path, newest: Path) -> None:
    """Delete the files, and what broken writes left, that were not used for longest."""
    with _locked(folder, LOCK_EX):
        total, now = 0, time.time()
        for used_s, size, file in sorted(_files(folder), reverse=True):
            total += size
            if total > MOST_BYTES and file != newest and now - used_s > IN_USE_S:
                with suppress(OSError):
                    file.unlink()


def _files(folder: Path) -> Iterator[tuple[float, int, Path]]:
    """Time of the last use, size and name."""
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.endswith((".so", ".o", ".tmp", ".lock")):
                with suppress(FileNotFoundError):  # a temporary one, renamed meanwhile
                    found = entry.stat(follow_symlinks=False)
                    yield found.st_mtime, found.st_size, Path(entry.path)


@contextmanager
def _alone(folder: Path, key: str) -> Iterator[None]:
    """Let others that would make the same wait; one that waited for long goes on beside them.

    The lock goes with its process.
    """
    file = folder / f".{key}.lock"
    until = time.monotonic() + LONGEST_WAIT_S
    while (handle := _lock(file)) is None and time.monotonic() < until:
        time.sleep(POLL_S)
    try:
        yield
    finally:
        if handle is not None:
            file.unlink(missing_ok=True)
            os.close(handle)


def _lock(file: Path) -> int | None:
    """Return the descriptor of a lock file that is locked and still there; None if another's is."""
    handle = os.open(file, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o600)
    try:
        flock(handle, LOCK_EX | LOCK_NB)
        if os.path.samestat(os.fstat(handle), file.stat()):
            return handle
    except (BlockingIOError, FileNotFoundError):
        pass
    except OSError:  # some network file systems do not lock: then each makes its own
        return handle
    os.close(handle)
    return None


@contextmanager
def _locked(folder: Path, how: int) -> Iterator[None]:
    """Let nothing be deleted between the check of a file and the note that it is in use."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        with suppress(OSError):  # some network file systems lock no folders
            flock(handle, how)
        yield
    finally:
        os.close(handle)
