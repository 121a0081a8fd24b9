"""Many HTTP clients in one process, each with one connection that asks again as soon as it has its answer.

    python -m load_tests.benchmarks.gateway.rest_client < JSON
    {"port", "keys", "paths", "clients", "seconds", "conditional"}

Prints JSON: median and 99th percentile in seconds, number and bytes of what was asked for in the last four fifths of
the time, answers by status, how many there were in all, and the share of a core that this process took: near 1 it is
the limit, and not the server. Bare protocols on the gateway's own event loop, so that little of it is measured.
"""

from __future__ import annotations

import asyncio
import json
import random
import sys
import time
from collections import Counter
from typing import Any

from gateway.main import new_event_loop

__all__ = ["main"]

WARM = 0.2  # of the time


class Tally:
    """What all clients together have seen."""

    def __init__(self, seconds: float) -> None:
        self.begins = time.perf_counter() + seconds * WARM
        self.ends = time.perf_counter() + seconds
        self.latencies: list[float] = []
        self.statuses: Counter[str] = Counter()
        self.size_bytes = 0
        self.answered = 0


class Client(asyncio.Protocol):
    """One connection, one request at a time."""

    def __init__(self, asked: dict[str, Any], number: int, tally: Tally) -> None:
        self._asked = asked
        self._key = asked["keys"][number % len(asked["keys"])]
        self._rng = random.Random(number)
        self._tally = tally
        self._tags: dict[str, str] = {}
        self._path = ""
        self._asked_at = 0.0
        self._head = b""  # of the answer, until all of it is there
        self._missing = 0  # bytes of its body
        self.over = asyncio.get_running_loop().create_future()

    def connection_made(self, transport: Any) -> None:
        """Begin."""
        self._transport = transport
        self._ask()

    def data_received(self, data: bytes) -> None:
        """A piece of the answer; behind its last one comes the next request."""
        if self._missing:
            self._missing -= len(data)
        else:
            self._head += data
            head, end, body = self._head.partition(b"\r\n\r\n")
            if not end:
                return
            self._status, size = self._read(head.decode("latin-1").split("\r\n"))
            self._size = len(head) + len(end) + size
            self._head, self._missing = b"", size - len(body)
        if self._missing == 0:
            self._note()
            self._ask()

    def connection_lost(self, exc: Exception | None) -> None:
        """Its time is over, or the server's patience."""
        if not self.over.done():
            self.over.set_exception(exc or ConnectionError("the gateway closed a connection"))

    def _ask(self) -> None:
        self._asked_at = time.perf_counter()
        if self._asked_at >= self._tally.ends:
            self.over.set_result(None)
            self._transport.close()
            return
        self._path = self._rng.choice(self._asked["paths"])
        known = self._tags.get(self._path) if self._asked["conditional"] else None
        tag = f"If-None-Match: {known}\r\n" if known else ""
        head = f"GET {self._path} HTTP/1.1\r\nHost: 127.0.0.1\r\nAuthorization: Bearer {self._key}\r\n{tag}\r\n"
        self._transport.write(head.encode())

    def _read(self, lines: list[str]) -> tuple[str, int]:
        """Status and size of the body; the tag is kept."""
        fields = {name.lower(): value for name, _, value in (line.partition(": ") for line in lines[1:])}
        self._tags[self._path] = fields.get("etag", "")
        return lines[0].split(" ")[1], int(fields.get("content-length", "0"))

    def _note(self) -> None:
        tally = self._tally
        tally.answered += 1
        if self._asked_at >= tally.begins:
            tally.latencies.append(time.perf_counter() - self._asked_at)
            tally.statuses[self._status] += 1
            tally.size_bytes += self._size


async def _run(asked: dict[str, Any]) -> Tally:
    loop, tally, clients = asyncio.get_running_loop(), Tally(asked["seconds"]), []
    for number in range(asked["clients"]):
        client = Client(asked, number, tally)
        await loop.create_connection(lambda client=client: client, "127.0.0.1", asked["port"])  # type: ignore[misc]
        clients.append(client)
    await asyncio.gather(*(client.over for client in clients))
    return tally


def main() -> int:
    """Read what to do, do it, print what came of it."""
    asked = json.load(sys.stdin)
    began_cpu_s, began_s = time.process_time(), time.perf_counter()
    with asyncio.Runner(loop_factory=new_event_loop) as runner:
        tally = runner.run(_run(asked))
    core = (time.process_time() - began_cpu_s) / (time.perf_counter() - began_s)
    latencies, count = sorted(tally.latencies), len(tally.latencies)
    found = {"statuses": tally.statuses, "bytes": tally.size_bytes, "answered": tally.answered, "core": core}
    print(json.dumps({**found, "count": count, "p50_s": latencies[count // 2], "p99_s": latencies[count * 99 // 100]}))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
