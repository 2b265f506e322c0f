"""The walls around a student's process: how long, how much, where it may write, and that it talks to nobody.

Three layers, each of which may be missing, and ``Walls.in_force`` says which took hold:

- limits of the system (``setrlimit``): processor time, memory, size of a file, open files; on every POSIX system;
- Linux: namespaces of its own (no network, no sight of other processes) and Landlock (reads the Python installation and
  the course's package, writes its own folder, starts no program);
- Python's audit hook: the same rules, said in words that a student understands.  A determined student can get round
  it, by native code for example; so alone, where the second layer is missing, it stops accidents and not attacks.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import resource
import struct
import sys
from pathlib import Path
from typing import Any

from grading.limits import Limits

CLONE = {"users": 0x10000000, "processes": 0x20000000, "network": 0x40000000, "messages": 0x08000000}
FILE, READ, READ_DIR = 0b10, 0b100, 0b1000  # Landlock's rights; write a file, read a file, list a folder
TRUNCATE, FILE_SYSTEM = 1 << 14, {1: 13, 2: 14, 3: 15, 4: 15}  # version → how many rights it knows
CONNECTING = {"socket.connect", "socket.bind", "socket.sendto", "socket.getaddrinfo", "socket.gethostbyname"}
STARTING = {
    "subprocess.Popen",
    "os.system",
    "os.exec",
    "os.posix_spawn",
    "os.spawn",
    "os.fork",
    "os.forkpty",
    "pty.spawn",
}
HURTING = {"os.kill", "os.killpg", "signal.pthread_kill"}
CHANGING = {
    "os.remove",
    "os.rename",
    "os.rmdir",
    "os.mkdir",
    "os.chmod",
    "os.chown",
    "os.link",
    "os.symlink",
    "os.truncate",
}


def alone() -> list[str]:
    """Leave the network and the other processes, before the student's process is forked; says what took hold."""
    if not sys.platform.startswith("linux"):
        return []
    unshare = ctypes.CDLL(None, use_errno=True).unshare
    for kinds in (("users", "processes", "network", "messages"), ("users", "network"), ("network",)):
        if unshare(sum(CLONE[kind] for kind in kinds)) == 0:
            return [f"{kind} namespace" for kind in kinds if kind in ("processes", "network")]
    return []


def close_in(folder: Path, readable: list[Path], limits: Limits, seconds: float) -> list[str]:
    """Put this process behind its walls; says what took hold.  ``seconds`` of processor time."""
    held = []
    megabyte = 1 << 20
    used = 0
    if sys.platform.startswith("linux"):
        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    for name, most in (
        ("CPU", int(seconds) + 2),
        ("AS", used + limits.memory * megabyte),
        ("FSIZE", limits.file_size * megabyte),
        ("NOFILE", 256),
        ("CORE", 0),
    ):
        _limit(getattr(resource, f"RLIMIT_{name}"), most)
    held.append("time, memory and file limits")
    if _landlock(folder, readable):
        held.append("Landlock")
    sys.addaudithook(_hook(folder))
    return [*held, "audit hook"]


def _limit(kind: int, most: int) -> None:
    _, hard = resource.getrlimit(kind)
    most = most if hard == resource.RLIM_INFINITY else min(most, hard)
    with contextlib.suppress(ValueError, OSError):  # macOS refuses some limits on memory
        resource.setrlimit(kind, (most, most))


def _landlock(folder: Path, readable: list[Path]) -> bool:
    """Landlock's rules for this process and all its children; False where the kernel has none."""
    if not sys.platform.startswith("linux"):
        return False
    libc = ctypes.CDLL(None, use_errno=True)
    libc.syscall.restype = ctypes.c_long
    create, add, restrict = 444, 445, 446
    version = libc.syscall(create, None, ctypes.c_size_t(0), ctypes.c_uint(1))
    if version < 1:
        return False
    rights = (1 << FILE_SYSTEM.get(version, 16)) - 1
    # TCP is ruled out from version 4 on, signals and abstract sockets from version 6 on.
    attributes = struct.pack("QQQ", rights, 3 if version >= 4 else 0, 3 if version >= 6 else 0)
    size = 8 if version < 4 else 16 if version < 6 else 24
    rules = libc.syscall(create, attributes, ctypes.c_size_t(size), ctypes.c_uint(0))
    if rules < 0:
        return False
    allowed = [(path, READ | READ_DIR) for path in readable] + [(folder, rights & ~1), (Path(os.devnull), READ | FILE)]
    for path, access in allowed:
        if not path.exists():
            continue
        if not path.is_dir():
            access &= READ | FILE
        handle = os.open(path, os.O_PATH | os.O_CLOEXEC)
        libc.syscall(add, rules, 1, struct.pack("=Qi", access & rights, handle), ctypes.c_uint(0))
        os.close(handle)
    no_new_privileges = 38
    libc.prctl(no_new_privileges, 1, 0, 0, 0)
    took = libc.syscall(restrict, rules, ctypes.c_uint(0)) == 0
    os.close(rules)
    return took


def _hook(folder: Path) -> Any:
    inside = str(folder.resolve()) + os.sep
    # Everything that the hook calls is bound here: a student's code cannot put something else in its place.
    absolute, fspath, joined, strings = os.path.realpath, os.fspath, os.path.join, (str, bytes)
    refused, flags = PermissionError, os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
    connecting, starting, hurting, changing, null = CONNECTING, STARTING, HURTING, CHANGING, os.devnull

    def outside(path: Any) -> bool:
        if isinstance(path, int):
            return False
        text = fspath(path)
        text = text.decode(errors="replace") if isinstance(text, bytes) else text
        return not (absolute(text) + "/").startswith(inside) and text != null

    def hook(event: str, arguments: tuple) -> None:
        if event == "open":
            path, mode, how = arguments
            writes = any(c in mode for c in "wxa+") if isinstance(mode, str) else bool((how or 0) & flags)
            if writes and outside(path):
                raise refused("a graded notebook may write into its own folder only")
        elif event in changing:
            if any(isinstance(path, strings) and outside(path) for path in arguments):
                raise refused("a graded notebook may change files in its own folder only")
        elif event in connecting:
            raise refused("a graded notebook may not open a connection")
        elif event in starting:
            raise refused("a graded notebook may not start another program")
        elif event in hurting:
            raise refused("a graded notebook may not send signals to processes")

    del joined
    return hook


def readable(package: Path, data: list[Path]) -> list[Path]:
    """What a student's process may read: Python, the libraries, the course's package and its recordings.

    Not the folder of the course as a whole: the solved labs are there.
    """
    python = [Path(p) for p in {sys.prefix, sys.base_prefix}] + [Path(p) for p in sys.path if "site-packages" in p]
    system = [Path(p) for p in ("/usr", "/lib", "/lib64", "/etc", "/dev/urandom", "/dev/zero", "/System", "/Library")]
    return [*python, package, *data, *system]
