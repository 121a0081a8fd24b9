"""Free TCP ports for servers under test.

Below the range from which the system takes ports for outgoing connections, a part for each xdist worker, and never the
same twice in a process: a port that is free now must still be free when the program that is told of it has started.
"""

from __future__ import annotations

import itertools
import os
import socket

__all__ = ["free_port"]

_FIRST, _PER_WORKER, _WORKERS = 12_000, 2_500, 8
_worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")) % _WORKERS
# Runs beside each other on one machine begin at different places.
_numbers = itertools.count(os.getpid() * 131 % _PER_WORKER)


def free_port(host: str = "127.0.0.1") -> int:
    """A port that nobody uses and that this process has not given out lately."""
    for number in _numbers:
        port = _FIRST + _worker * _PER_WORKER + number % _PER_WORKER
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((host, port))
            except OSError:
                continue
        return port
    raise AssertionError("unreachable")
