"""One viewer of a hundred that never reads: what the others notice, what it costs the gateway, and its end.

Rounds with and without it take turns. A p99 of one run is a handful of its worst moments, so the latencies of all
rounds are pooled, and the odd rounds without it are compared with the even ones in the same way: a change below that
says nothing.
"""

from __future__ import annotations

import functools
import select
import socket
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from load_tests.fanout.client import StreamViewer
from load_tests.fanout.load import Load
from load_tests.fanout.measure import Figures, Server, median, percentile_ms
from load_tests.figures import note

__all__ = ["stall"]

LOAD = Load(8.0, 60.0, 16384)
BOUND_MIB = 24.0  # its 8 MiB of samples, what the transport and its records take beside it, and noise
GOAL = 0.10


class _Deaf(StreamViewer):
    """Its system takes little, so that the gateway soon notices."""

    def subscribe(self) -> None:
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 16384)
        super().subscribe()


@dataclass(frozen=True)
class _Seen:
    """What the rounds showed."""

    alone: list[Figures] = field(default_factory=list)
    beside: list[Figures] = field(default_factory=list)
    growth_mib: list[float] = field(default_factory=list)
    ends: list[str] = field(default_factory=list)


def stall(*, rounds: int, seconds: float, viewers: int, pin: bool) -> int:
    """Print what `viewers` see with and without the one; 1 when it was not cut, or cost too much memory."""
    stall_s = seconds * 0.375  # so that a round has both: it hangs on, and it is gone
    server = Server("servers", "--tick-ms", "5", "--stall-s", str(stall_s), *(["--core", "0"] if pin else []))
    seen = _Seen()
    try:
        _rounds(server, replace(LOAD, seconds=seconds), viewers, rounds, seen)
    finally:
        server.stop()
    print(f"| {viewers} viewers, 60/s of 16 KiB | p50 ms | p99 ms | p99 of each round | cores | others' cores |")
    print("|---|---|---|---|---|---|")
    for name, runs in (("alone", seen.alone), ("beside one that never reads", seen.beside)):
        each = sorted(run.p99_ms for run in runs)
        print(
            f"| {name} | {_pooled_ms(runs, 0.5):.2f} | {_pooled_ms(runs, 0.99):.2f} | {median(runs, 'p99_ms'):.2f} "
            f"({each[0]:.2f}–{each[-1]:.2f}) | {median(runs, 'cores'):.3f} | {median(runs, 'foreign_cores'):.2f} |"
        )
    _print_change(seen)
    most_mib = max(seen.growth_mib)
    print(f"resident memory grew by at most {most_mib:.1f} MiB; its end: {', '.join(sorted(set(seen.ends)))}")
    return int(most_mib > BOUND_MIB or "open" in seen.ends)


def _rounds(server: Server, load: Load, viewers: int, rounds: int, seen: _Seen) -> None:
    kind = functools.partial(StreamViewer, size=load.size)
    server.run(load, viewers, kind)  # what the process needs anyway is there afterwards
    for _ in range(rounds):
        seen.alone.append(server.run(load, viewers, kind))
        before_mib, deaf = server.resident_mib(), _Deaf(server.port, size=load.size)
        seen.beside.append(server.run(load, viewers, kind))
        seen.growth_mib.append(server.resident_mib() - before_mib)
        seen.ends.append(_end(deaf.socket))
        deaf.socket.close()


def _print_change(seen: _Seen) -> None:
    pooled = _pooled_ms(seen.beside, 0.99) / _pooled_ms(seen.alone, 0.99) - 1
    middle = median(seen.beside, "p99_ms") / median(seen.alone, "p99_ms") - 1
    note("one of 100 that never reads: p99 of the others, with ÷ without", [1 + pooled])
    print(f"p99 of all latencies changes by {pooled:+.1%} (goal: < {GOAL:.0%}), the median p99 by {middle:+.1%}")
    if len(seen.alone) < 2:
        print("noise: unknown, of one round")
        return
    odd, even = _pooled_ms(seen.alone[::2], 0.99), _pooled_ms(seen.alone[1::2], 0.99)
    print(f"noise: alone, the even rounds' p99 differs from the odd ones' by {even / odd - 1:+.1%}")


def _pooled_ms(runs: Sequence[Figures], share: float) -> float:
    """Of the latencies of all runs together."""
    return percentile_ms(sorted(latency for run in runs for latency in run.latencies_ns), share)


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
