"""A change of the whole fleet's twins: how long until it is accepted, and until every robot lives by it.

    python -m load_tests twin [--robots 1000] [--rounds 3] [--engines sqlite,postgres] [--quick]

A gateway in this process, with SQLite and then with a PostgreSQL of its own, its robots in another one, over gRPC on
loopback, all on this machine's cores. Each round is one request: in turn a merge patch of every robot's document, and
a template for half of them. Accepted is the time of the HTTP request, in which the database has the change on disk;
converged is from its beginning until the last robot has had its revision confirmed. 1 is returned when an acceptance
takes over `--accept-s`, or a convergence over `--converge-s`.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import httpx

from gateway.domain.principal import Role
from load_tests.figures import note
from tests.gateway.harness import RING, client, running_gateway
from tests.support.servers.postgres import PostgresServer

__all__ = ["main"]

WAIT_S = 300.0


async def _line(robots: asyncio.subprocess.Process, wanted: str) -> None:
    assert robots.stdout is not None
    async with asyncio.timeout(WAIT_S):
        while (line := await robots.stdout.readline()).strip() != wanted.encode():
            if not line:
                raise SystemExit("the robots' process ended")


async def _round(http: httpx.AsyncClient, robots: asyncio.subprocess.Process, number: int) -> tuple[float, float]:
    document = {
        "topics": {f"camera_{n}/image": {"class": "live", "rate_hz": float(number)} for n in range(4)},
        "parameters": {"/lidar": {"rate_hz": 10.0 + number}},
        "budget": {"bytes_per_s": 100_000 + number},
    }
    began = time.perf_counter()
    if number % 2:
        answer = await http.patch("/api/v1/twins", params={"selector": ""}, json=document)
    else:
        part = {"nodes": {"lidar": {"allowed": "lidar", "nice": number % 19}}}
        answer = await http.put("/api/v1/templates/nodes", json={"selector": "", "document": part})
    accepted = time.perf_counter() - began
    answer.raise_for_status()
    await _line(robots, f"revision {number}")
    return accepted, time.perf_counter() - began


async def _measure(count: int, rounds: int, *, url: str) -> list[tuple[float, float]]:
    key = RING.add(role=Role.ADMIN, name="bench")
    with tempfile.TemporaryDirectory() as folder:
        async with running_gateway(Path(folder), store_url=url) as ready, client(ready, key=key) as http:
            program = [
                sys.executable,
                "-m",
                "load_tests.benchmarks.gateway.twin_robots",
                str(ready.grpc_port),
                str(count),
            ]
            robots = await asyncio.create_subprocess_exec(*program, stdout=asyncio.subprocess.PIPE)
            try:
                began = time.perf_counter()
                await _line(robots, "up")
                print(f"{count} robots linked in {time.perf_counter() - began:.1f} s", flush=True)
                return [await _round(http, robots, number) for number in range(1, rounds + 1)]
            finally:
                if robots.returncode is None:
                    robots.kill()
                await robots.wait()


def main(argv: Sequence[str] = ()) -> int:
    """Print each round; 1 when one is over its limit."""
    parser = argparse.ArgumentParser(prog="python -m load_tests twin")
    parser.add_argument("--robots", type=int, default=1000)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--engines", default="sqlite,postgres")
    parser.add_argument("--accept-s", type=float, default=1.0)
    parser.add_argument("--converge-s", type=float, default=30.0)
    parser.add_argument("--quick", action="store_true", help="100 robots, 2 rounds")
    chosen = parser.parse_args(argv)
    count, rounds = (100, 2) if chosen.quick else (chosen.robots, chosen.rounds)
    good = True
    for engine in chosen.engines.split(","):
        server = PostgresServer(durable=True) if engine == "postgres" else None
        try:
            if server is not None:
                server.start()
            url = server.schema() if server is not None else ""
            found = asyncio.run(_measure(count, rounds, url=url))
        finally:
            if server is not None:
                server.close()
        note(f"accepted, {engine}", [accepted for accepted, _ in found])
        note(f"converged, {engine}", [converged for _, converged in found])
        for number, (accepted, converged) in enumerate(found, 1):
            kind = "merge patch of every robot" if number % 2 else "template for every robot"
            print(f"{engine:9} {kind:27} accepted in {accepted:6.3f} s, converged in {converged:6.2f} s", flush=True)
            good = good and accepted <= chosen.accept_s and converged <= chosen.converge_s
    print(f"{os.cpu_count()} cores, load of the last minute {os.getloadavg()[0]:.1f} (ours is 2)")
    return int(not good)
