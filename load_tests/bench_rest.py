"""Lists of a large fleet: pages of 100 of 10,000 robots, asked for by 50 clients at a time.

    python -m load_tests rest [--robots 10000] [--online 500] [--clients 50] [--seconds 6] [--rounds 5] [--quick]

A gateway in this process, on SQLite; its robots linked from a second process, the clients in a third, all on loopback
and on this machine's cores. Every client has a key of its own and one connection, and asks for a page at a random
place as soon as it has the one before. `online` robots have a living link; the others are known from earlier days.
1 is returned when the median of the rounds' p99 of whole pages is over 50 ms.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gateway.domain.principal import Role
from gateway.heap import settle_heap
from gateway.main import Ready, new_event_loop
from gateway.store.engines import open_engine
from tests.gateway.harness import RING, client, running_gateway

__all__ = ["main"]

GOAL_MS = 50.0
WAIT_S = 300.0
LABELS = '{"site":"berlin","kind":"amr","line":"%d"}'
KINDS = {
    "page of 100": ("", False),
    "of which 4 fields": ("&fields=id,state,labels,last_seen", False),
    "with If-None-Match": ("&fields=id,state,labels", True),
    "by selector": ("&selector=site%3Dberlin", False),
}


@dataclass(frozen=True, slots=True)
class Round:
    """What one round showed."""

    per_s: float
    p50_ms: float
    p99_ms: float
    cpu_us: float
    kib: float
    statuses: str


def _fill(folder: Path, count: int) -> None:
    """Robots of earlier days."""
    (folder / "data").mkdir()
    engine, _ = open_engine("", folder / "data")
    now_ns = time.time_ns()
    with engine.transaction(write=True):
        engine.many(
            "INSERT INTO robots (id, namespace, hostname, agent_version, labels, first_seen_ns, last_seen_ns)"
            " VALUES (?, ?, ?, ?, ?, ?, ?)",
            [
                (f"robot_{n:04}", f"/robot_{n:04}", f"host-{n}", "2.0.0", LABELS % (n % 20), now_ns, now_ns)
                for n in range(count)
            ],
        )
    engine.close()


async def _ask(ready: Ready, keys: list[str], chosen: argparse.Namespace, kind: str) -> Round:
    query, conditional = KINDS[kind]
    starts = [f"robot_{n:04}" for n in range(0, chosen.robots - 100, 100)]
    asked = {
        "port": int(ready.url.rpartition(":")[2]),
        "keys": keys,
        "clients": chosen.clients,
        "seconds": chosen.seconds,
        "conditional": conditional,
        "paths": [f"/api/v1/robots?limit=100&after={start}{query}" for start in starts],
    }
    before_s = resource.getrusage(resource.RUSAGE_SELF)
    program, text = [sys.executable, "-m", "load_tests.rest_client"], json.dumps(asked).encode()
    done = await asyncio.to_thread(subprocess.run, program, input=text, stdout=subprocess.PIPE, check=True)
    used_s = resource.getrusage(resource.RUSAGE_SELF)
    found: dict[str, Any] = json.loads(done.stdout)
    latencies = sorted(found["latencies"])
    count, span_s = len(latencies), chosen.seconds * 0.8
    cpu_s = (used_s.ru_utime + used_s.ru_stime - before_s.ru_utime - before_s.ru_stime) * 0.8
    return Round(
        per_s=count / span_s,
        p50_ms=latencies[count // 2] * 1e3,
        p99_ms=latencies[count * 99 // 100] * 1e3,
        cpu_us=cpu_s / count * 1e6,
        kib=found["bytes"] / count / 1024,
        statuses=" ".join(f"{status}:{number}" for status, number in found["statuses"].items()),
    )


async def _measure(chosen: argparse.Namespace) -> dict[str, list[Round]]:
    keys = [RING.add(role=Role.VIEWER, name=f"client {number}") for number in range(chosen.clients)]
    rounds: dict[str, list[Round]] = {kind: [] for kind in KINDS}
    with tempfile.TemporaryDirectory() as folder:
        await asyncio.to_thread(_fill, Path(folder), chosen.robots)
        async with running_gateway(Path(folder)) as ready, client(ready) as http:
            settle_heap()  # as `metaros gateway` does
            listed = await http.get("/api/v1/robots", params={"fields": "id"})
            assert len(listed.json()["robots"]) == chosen.robots
            program = [sys.executable, "-m", "load_tests.twin_robots", str(ready.grpc_port), str(chosen.online)]
            robots = await asyncio.create_subprocess_exec(*program, stdout=asyncio.subprocess.PIPE)
            try:
                assert robots.stdout is not None
                async with asyncio.timeout(WAIT_S):
                    while (await robots.stdout.readline()).strip() != b"up":
                        pass
                for _ in range(chosen.rounds):
                    for kind in KINDS:
                        rounds[kind].append(await _ask(ready, keys, chosen, kind))
            finally:
                if robots.returncode is None:
                    robots.kill()
                await robots.wait()
    return rounds


def main(argv: Sequence[str] = ()) -> int:
    """Print medians of interleaved rounds; 1 when whole pages are over their goal."""
    parser = argparse.ArgumentParser(prog="python -m load_tests rest")
    parser.add_argument("--robots", type=int, default=10_000)
    parser.add_argument("--online", type=int, default=500)
    parser.add_argument("--clients", type=int, default=50)
    parser.add_argument("--seconds", type=float, default=6.0)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--quick", action="store_true", help="20 robots online, 1 round of 2 s")
    chosen = parser.parse_args(argv)
    if chosen.quick:
        chosen.online, chosen.seconds, chosen.rounds = 20, 2.0, 1
    with asyncio.Runner(loop_factory=new_event_loop) as runner:
        found = runner.run(_measure(chosen))
    fleet = f"{chosen.robots} robots, {chosen.online} online"
    print(f"{fleet}, {chosen.clients} clients, medians of {chosen.rounds} rounds")
    for kind, rounds in found.items():
        spread = f"{min(item.p99_ms for item in rounds):.1f}-{max(item.p99_ms for item in rounds):.1f}"
        middle = {
            name: statistics.median(getattr(item, name) for item in rounds)
            for name in ("per_s", "p50_ms", "p99_ms", "cpu_us", "kib")
        }
        print(
            f"{kind:20} {middle['per_s']:7.0f} /s  p50 {middle['p50_ms']:6.1f} ms  p99 {middle['p99_ms']:6.1f} ms"
            f" ({spread})  {middle['cpu_us']:6.0f} us CPU each  {middle['kib']:6.1f} KiB  {rounds[-1].statuses}"
        )
    print(f"{os.cpu_count()} cores, load of the last minute {os.getloadavg()[0]:.1f} (ours is 2)")
    return int(statistics.median(item.p99_ms for item in found["page of 100"]) > GOAL_MS)
