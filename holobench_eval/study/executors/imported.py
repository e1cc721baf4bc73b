"""What the process that workers are forked from imports before: what they need, and what lets it live on."""

import errno
import os
from importlib import import_module
from multiprocessing import reduction
from socket import socket

from .processes import ONE_THREAD, OURS, SAFE_PATH

if os.environ.get(SAFE_PATH) == OURS:  # not for the programs that a method starts
    del os.environ[SAFE_PATH]
os.environ.update(ONE_THREAD)  # read by libraries as they are imported
import_module("holobench_eval.optics.transfer").kernel()

_receive = reduction.recvfds


def _received(sock: socket, size: int) -> list[int]:
    """As ``recvfds``. The server ends with an EOFError of it, but goes on after a connection that was aborted: so is
    that of a process which was killed while it asked for another one."""
    try:
        return _receive(sock, size)
    except EOFError as error:
        raise ConnectionAbortedError(errno.ECONNABORTED, "the client has ended") from error


reduction.recvfds = _received
