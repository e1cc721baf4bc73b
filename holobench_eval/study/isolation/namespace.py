"""A world of its own for the process of a method: namespaces of Linux (namespaces(7)).

From within no other process can be named, and so none can be stopped, killed or written to; whatever the method starts
ends with it. Where the system lets nobody make namespaces, ``enter`` says so, and the process keeps what its user may.
"""

from __future__ import annotations

import ctypes
import os
import signal
from contextlib import suppress
from pathlib import Path

libc = ctypes.CDLL(None)

CLONE_NEWNS, CLONE_NEWUSER, CLONE_NEWPID = 0x20000, 0x10000000, 0x20000000  # unshare(2)
MS_REC, MS_PRIVATE = 0x4000, 0x40000  # mount(2)
PR_SET_PDEATHSIG, PR_SET_CHILD_SUBREAPER = 1, 36  # prctl(2)


def enter() -> bool:
    """Go on as the first process of new namespaces, in a fork of this one, which waits for it and ends as it does.

    False, and nothing has changed, where the system forbids any part of it; a process of its own tries that out first.
    """
    if (trial := os.fork()) == 0:
        with suppress(OSError):
            _enter()
            os._exit(0)
        os._exit(1)
    if os.waitpid(trial, 0)[1]:
        return False
    _enter()
    return True


def _enter() -> None:
    _unshare(CLONE_NEWUSER | CLONE_NEWPID | CLONE_NEWNS)
    if first := os.fork():
        _end_as(os.waitpid(first, 0)[1])
    end_with_parent()
    # So that a number of /proc is one of this namespace; the mount is seen in it alone.
    if libc.mount(b"none", b"/", None, MS_REC | MS_PRIVATE, None) or libc.mount(b"proc", b"/proc", b"proc", 0, None):
        raise OSError("no /proc of its own")
    # What is mounted in the namespace above can be taken away by nobody in one below (mount_namespaces(7)), whatever
    # that one may: else the method could bare the /proc of all processes, and write to what it has of its user's.
    _unshare(CLONE_NEWUSER | CLONE_NEWNS)


def _unshare(namespaces: int) -> None:
    """Enter new namespaces as the same user. OSError where the system forbids it."""
    user, group = os.geteuid(), os.getegid()
    if libc.unshare(namespaces):
        raise OSError("no namespaces")
    Path("/proc/self/uid_map").write_text(f"{user} {user} 1")
    Path("/proc/self/setgroups").write_text("deny")  # else who is not root may map no group, user_namespaces(7)
    Path("/proc/self/gid_map").write_text(f"{group} {group} 1")


def end_with_parent() -> None:
    """Let the system kill this process when the thread that forked it ends."""
    libc.prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


def adopt() -> None:
    """Let the processes whose parent has ended before them become children of this one."""
    libc.prctl(PR_SET_CHILD_SUBREAPER, 1)


def _end_as(status: int) -> None:
    code = os.waitstatus_to_exitcode(status)
    if code < 0:
        with suppress(OSError):  # no process sets what SIGKILL does
            signal.signal(-code, signal.SIG_DFL)
        os.kill(os.getpid(), -code)
    os._exit(code)
