"""Many HTTP clients in one process, each with one connection that asks again as soon as it has its answer.

    python -m load_tests.rest_client < JSON     {"port", "keys", "paths", "seconds", "conditional"}

Prints JSON: latencies in seconds, bytes, answers by status. A client of ours, so that little of it is measured.
"""

from __future__ import annotations

import asyncio
import json
import random
import sys
import time
from collections import Counter
from typing import Any

__all__ = ["main"]


class Tally:
    """What all clients together have seen."""

    def __init__(self) -> None:
        self.latencies: list[float] = []
        self.statuses: Counter[str] = Counter()
        self.size_bytes = 0


async def _answer(reader: asyncio.StreamReader) -> tuple[str, str, int]:
    """Status, ETag and size of the next answer."""
    head = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1")
    lines = head.split("\r\n")
    fields = {name.lower(): value for name, _, value in (line.partition(": ") for line in lines[1:])}
    size = int(fields.get("content-length", "0"))
    if size:
        await reader.readexactly(size)
    return lines[0].split(" ")[1], fields.get("etag", ""), len(head) + size


async def _client(asked: dict[str, Any], number: int, tally: Tally, rng: random.Random) -> None:
    reader, writer = await asyncio.open_connection("127.0.0.1", asked["port"], limit=1 << 22)
    tags: dict[str, str] = {}
    ends = time.perf_counter() + asked["seconds"]
    begins = time.perf_counter() + asked["seconds"] * 0.2  # what comes before warms up
    while (now := time.perf_counter()) < ends:
        path = rng.choice(asked["paths"])
        tag = f"If-None-Match: {tags[path]}\r\n" if asked["conditional"] and path in tags else ""
        key = asked["keys"][number % len(asked["keys"])]
        head = f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nAuthorization: Bearer {key}\r\n{tag}\r\n"
        writer.write(head.encode())
        status, tags[path], size = await _answer(reader)
        if now >= begins:
            tally.latencies.append(time.perf_counter() - now)
            tally.statuses[status] += 1
            tally.size_bytes += size
    writer.close()


async def _run(asked: dict[str, Any]) -> Tally:
    tally = Tally()
    rngs = [random.Random(number) for number in range(asked["clients"])]
    await asyncio.gather(*(_client(asked, number, tally, rng) for number, rng in enumerate(rngs)))
    return tally


def main() -> int:
    """Read what to do, do it, print what came of it."""
    tally = asyncio.run(_run(json.load(sys.stdin)))
    print(json.dumps({"latencies": tally.latencies, "statuses": tally.statuses, "bytes": tally.size_bytes}))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
