"""One process of a pair: opens a peer's endpoints and obeys the lines it reads. Standard library only.

It runs under the Python of the peer's own environment, so it imports nothing of ours but the peer's module, which has

    sender(job, topic) -> send             send() publishes one payload of job["size"] bytes
    receiver(job, topic, callback)         callback() after each message, once its bytes are there
    spin(job)                              only where callbacks need the main thread; it does not return
    broker(job)                            only where the peer needs a third process

Lines on stdin are commands, lines on stdout JSON answers; the end of stdin is the end of the process. Commands of a
publisher and a subscriber are read on a thread that a program of the peer would not have: it is not counted.
"""

from __future__ import annotations

import importlib
import itertools
import json
import os
import sys
import threading
import time
import traceback
from collections.abc import Callable
from typing import Any

__all__ = ["Pings", "Tally", "main", "quantile"]

_WARM_UP_PINGS = 50
_WARM_UP_PATIENCE_S = 0.2  # the first pings may find nobody yet
_STRAY_S = 0.2  # answers to a ping that was given up are waited for, and ignored
_HOPELESS = 12  # pings lost in a row


class Tally:
    """Counts calls of `tick`, a C function: the same small cost in every peer's callback."""

    def __init__(self) -> None:
        self.tick: Callable[[], int] = itertools.count().__next__
        self._reads = 0

    def read(self) -> int:
        """How often `tick` was called so far."""
        value = self.tick() - self._reads
        self._reads += 1
        return value


class Pings:
    """A chain of round trips: each answer, in the peer's callback, stamps the time and sends the next."""

    def __init__(self) -> None:
        self.send: Callable[[], object] = lambda: None
        self.took_ns: list[int] = []
        self.resent = 0
        self._wanted = 0
        self._pause_s = 0.0
        self._began_ns = 0
        self._end_ns = 0
        self._changed = threading.Event()

    def answered(self) -> None:
        """An answer has arrived."""
        now_ns = time.perf_counter_ns()
        if not self._began_ns:  # an answer to a ping that was given up
            return
        self.took_ns.append(now_ns - self._began_ns)
        self._began_ns = 0
        if len(self.took_ns) < self._wanted and now_ns < self._end_ns and not self._pause_s:
            self._began_ns = time.perf_counter_ns()
            self.send()
        else:
            self._changed.set()

    def run(self, count: int, limit_s: float, *, pause_s: float = 0.0, patience_s: float = 1.0) -> None:
        """Up to `count` round trips in about `limit_s`; one that takes over `patience_s` is given up and sent again."""
        self.took_ns, self.resent, self._wanted, self._pause_s, lost = [], 0, count, pause_s, 0
        self._end_ns = time.perf_counter_ns() + int(limit_s * 1e9)
        while len(self.took_ns) < count and (not self.took_ns or time.perf_counter_ns() < self._end_ns):
            time.sleep(pause_s)
            self._changed.clear()
            self._began_ns = time.perf_counter_ns()
            self.send()
            if self._chain_ends(patience_s):
                lost = 0
                continue
            self._began_ns = 0
            time.sleep(_STRAY_S)
            self.resent, lost, patience_s = self.resent + 1, lost + 1, min(2.0, patience_s * 1.5)
            if lost > _HOPELESS:
                raise TimeoutError(f"{lost} pings in a row were not answered")
        self._began_ns = 0

    def _chain_ends(self, patience_s: float) -> bool:
        """Wait for the last answer of the chain; False when the chain has broken."""
        seen = -1
        while not self._changed.wait(patience_s):
            if seen == len(self.took_ns):
                return False
            seen = len(self.took_ns)
        return True


def quantile(values: list[int], share: float) -> float:
    """The value below which `share` of them lie; the nearest one there is."""
    ordered = sorted(values)
    return float(ordered[min(len(ordered) - 1, int(share * len(ordered)))])


def _answer_line() -> Callable[[object], None]:
    """Writes answers to what stdout was; whatever a library prints goes to stderr from here on."""
    out = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)

    def answer(value: object) -> None:
        out.write(json.dumps(value) + "\n")
        out.flush()

    return answer


def _snapshot(count: int) -> dict[str, float]:
    return {"count": count, "cpu_s": time.process_time(), "at_s": time.perf_counter()}


def _obey(answer: Callable[[object], None], count: Callable[[], int]) -> None:
    """A snapshot for each line, on a thread of its own."""

    def run() -> None:
        for _ in sys.stdin:
            answer({"count": count(), "cpu_s": time.process_time(), "at_s": time.perf_counter()})
        os._exit(0)

    threading.Thread(target=run, daemon=True).start()


def _wait(peer: Any, job: dict[str, Any]) -> None:
    """Let callbacks come."""
    getattr(peer, "spin", lambda _: threading.Event().wait())(job)


def _receive(peer: Any, job: dict[str, Any], answer: Callable[[object], None]) -> None:
    """Count what arrives."""
    tally = Tally()
    for number in range(job["subscriptions"]):
        peer.receiver(job, f"flood{number}", tally.tick)
    answer("ready")
    _obey(answer, tally.read)
    _wait(peer, job)


def _publish(peer: Any, job: dict[str, Any], answer: Callable[[object], None]) -> None:
    """Flat out from the first command on."""
    send = peer.sender(job, "flood0")
    answer("ready")
    sys.stdin.readline()
    batch = 100 if job["size"] < 16384 else 1
    sent = 0
    _obey(answer, lambda: sent)
    while True:
        for _ in range(batch):
            send()
        sent += batch


def _echo(peer: Any, job: dict[str, Any], answer: Callable[[object], None]) -> None:
    """Answer each message in its callback."""
    peer.receiver(job, "ping", peer.sender(job, "pong"))
    answer("ready")
    _obey(answer, lambda: 0)
    _wait(peer, job)


def _ping(peer: Any, job: dict[str, Any], answer: Callable[[object], None]) -> None:
    """Warm up at the first command, measure at the second."""
    pings = Pings()
    peer.receiver(job, "pong", pings.answered)
    pings.send = peer.sender(job, "ping")
    if hasattr(peer, "spin"):
        threading.Thread(target=peer.spin, args=(job,), daemon=True).start()
    answer("ready")
    pause_s = job.get("ping_pause_s", 0.0)
    sys.stdin.readline()
    pings.run(1 if pause_s else _WARM_UP_PINGS, job["ping_s"], pause_s=pause_s, patience_s=_WARM_UP_PATIENCE_S)
    time.sleep(_STRAY_S)
    answer("warm")
    sys.stdin.readline()
    pings.run(job["pings"], job["ping_s"], pause_s=pause_s)
    p50, p99 = quantile(pings.took_ns, 0.5), quantile(pings.took_ns, 0.99)
    answer({"p50_us": p50 / 1e3, "p99_us": p99 / 1e3, "pings": len(pings.took_ns), "resent": pings.resent})
    sys.stdin.read()


def _broker(peer: Any, job: dict[str, Any], answer: Callable[[object], None]) -> None:
    """What the peer's processes meet at."""
    peer.broker(job)
    answer("ready")
    sys.stdin.read()


_ROLES = {"subscriber": _receive, "publisher": _publish, "echo": _echo, "ping": _ping, "broker": _broker}


def main(argv: list[str]) -> None:
    """The job is the only argument, as JSON; this does not return."""
    job = json.loads(argv[0])
    answer = _answer_line()
    try:
        peer = importlib.import_module(f"load_tests.peers.{job['module']}")
        _ROLES[job["role"]](peer, job, answer)
    except Exception as error:
        traceback.print_exc()
        answer({"error": f"{type(error).__name__}: {error}"})
    finally:
        sys.stderr.flush()
        os._exit(0)  # a measured session need not be taken down tidily
