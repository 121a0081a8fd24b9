"""One viewer of a hundred that never reads: what the others notice, what it costs the gateway, and its end."""

from __future__ import annotations

import functools
import select
import socket

from load_tests.fanout.client import StreamViewer
from load_tests.fanout.measure import Figures, Server, median
from load_tests.fanout.servers import Load

__all__ = ["stall"]

VIEWERS, STALL_S = 99, 3.0
LOAD = Load(8.0, 60.0, 16384)
BOUND_MIB = 24.0  # its 8 MiB of samples, what the transport and its records take beside it, and noise


class _Deaf(StreamViewer):
    """Its system takes little, so that the gateway soon notices."""

    def subscribe(self) -> None:
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 16384)
        super().subscribe()


def stall(*, rounds: int, pin: bool) -> int:
    """Print the medians with and without the one; 1 when a promise does not hold."""
    server = Server("gateway", "--tick-ms", "5", "--stall-s", str(STALL_S), *(["--core", "0"] if pin else []))
    alone: list[Figures] = []
    beside: list[Figures] = []
    growth: list[float] = []
    ends: list[str] = []
    try:
        kind = functools.partial(StreamViewer, size=LOAD.size)
        server.run(LOAD, VIEWERS, kind)  # what the process needs anyway is there afterwards
        for _ in range(rounds):
            alone.append(server.run(LOAD, VIEWERS, kind))
            before_mib, deaf = server.resident_mib(), _Deaf(server.port, size=LOAD.size)
            beside.append(server.run(LOAD, VIEWERS, kind))
            growth.append(server.resident_mib() - before_mib)
            ends.append(_end(deaf.socket))
            deaf.socket.close()
    finally:
        server.stop()
    change = median(beside, "p99_ms") / median(alone, "p99_ms") - 1
    print("| 99 viewers, 60/s of 16 KiB | p50 ms | p99 ms | cores |\n|---|---|---|---|")
    for name, runs in (("alone", alone), ("beside one that never reads", beside)):
        print(f"| {name} | {median(runs, 'p50_ms'):.2f} | {median(runs, 'p99_ms'):.2f} | {median(runs, 'cores'):.3f} |")
    print(f"p99 changes by {change * 100:+.1f} % (< 10); resident memory grew by at most {max(growth):.1f} MiB")
    print(f"its end: {', '.join(sorted(set(ends)))}")
    return int(max(growth) > BOUND_MIB or "open" in ends)


def _end(connection: socket.socket) -> str:
    """How the gateway ended a connection: "cut", or "open" where it did not."""
    connection.settimeout(5.0)
    try:
        while connection.recv(1 << 20):
            if not select.select([connection], [], [], 5.0)[0]:
                return "open"
    except OSError as error:
        return "open" if isinstance(error, TimeoutError) else "cut"
    return "cut"
