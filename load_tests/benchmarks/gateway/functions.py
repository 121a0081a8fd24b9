"""Calls of a function: our engine, our gateway and boto3, beside AWS's runtime interface emulator and bare processes.

    python -m load_tests functions [--rounds 5] [--calls 2000] [--quick]

Everything runs a handler that returns its event, on this machine, over loopback; our workers at the highest sandbox
level that the machine has, the emulator's without any. A round measures each row once, one after another, so that the
machine's mood meets all of them; a line has the median of the rounds, with the lowest and the highest. The engine runs
on the event loop that a gateway has. The emulator is made for one call at a time: of 16 clients it is asked only how
many calls fail, and it starts anew for each round. What it serves is AWS's Invoke, so the gateway is compared by its
own Invoke, signature and sandbox included, one client each. A call by REST is answered when its row of the audit log is
on the disk, and an event when it is in the queue, on the disk: they are told beside it. Bare are a forked process that
echoes JSON over a socket pair, uvicorn with our engine and nothing between, and an interpreter that imports AWS's
client and ends: nobody comes below those. Cold
starts and memory are of workers that have answered nothing else. 1 is returned when a goal of the table is missed.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import sys
import tempfile
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

from gateway.main import new_event_loop
from load_tests.figures import note
from load_tests.functions.bare import cold_interpreters, echo_json
from load_tests.functions.bare_server import running_bare_server
from load_tests.functions.clients import call_in_parallel, call_one_by_one
from load_tests.functions.engine_side import call_engine, cold_starts, running_engine, spec_of, worker_bytes
from load_tests.functions.figures import Calls, median, spread
from load_tests.functions.gateway_side import HANDLER, Functions, running_gateway
from load_tests.functions.rie import running_rie
from load_tests.peers.venvs import HomeFailed

__all__ = ["main"]

PARALLEL = 16
DURABLE_CLIENTS = 64
COLD = 5  # starts a round
Rows = dict[str, list[Calls]]


async def _engine_round(folder: Path, code: Path, calls: int, rows: Rows, more: dict[str, list[float]]) -> str:
    """In this process: the engine's own speed, its workers' starts and their size."""
    rows["bare echo of JSON"].append(await echo_json(calls))
    more["cold, bare interpreter with AWS's client ms"] += await asyncio.to_thread(cold_interpreters, COLD)
    async with running_engine(folder) as engine:
        rows["engine, one caller"].append(await call_engine(engine, spec_of(code), calls))
        rows["engine, 1 worker"].append(await call_engine(engine, spec_of(code), 2 * calls, at_once=PARALLEL))
        spec = spec_of(code, workers=2)
        rows["engine, 2 workers"].append(await call_engine(engine, spec, 2 * calls, at_once=PARALLEL))
        for pid in engine.pids(spec.key):
            for kind, size in worker_bytes(pid).items():
                more[f"worker {kind} MiB"].append(size / 2**20)
        more["cold, fork server ms"] += await cold_starts(engine, code, COLD)
        level = engine.status().level.name
    async with running_engine(folder, warm_start=False) as engine:
        more["cold, exec ms"] += await cold_starts(engine, code, COLD)
    return level


def _gateway_round(functions: Functions, calls: int, rows: Rows) -> None:
    request, event, invoke = functions.endpoint("request"), functions.endpoint("event"), functions.invoke()
    call_one_by_one(invoke, 20)
    rows["gateway, Invoke"].append(call_one_by_one(invoke, calls))
    rows[f"gateway, Invoke, {PARALLEL} clients"].append(call_in_parallel(invoke, PARALLEL, calls // PARALLEL))
    call_one_by_one(request, 20)
    rows["gateway, REST"].append(call_one_by_one(request, calls))
    rows[f"gateway, REST, {PARALLEL} clients"].append(call_in_parallel(request, PARALLEL, calls // PARALLEL))
    rows["gateway, boto3"].append(functions.call_with_boto3(calls // 2))
    rows["gateway, durable event"].append(call_one_by_one(event, calls // 4))
    rows[f"gateway, durable event, {DURABLE_CLIENTS} clients"].append(
        call_in_parallel(event, DURABLE_CLIENTS, calls // DURABLE_CLIENTS)
    )


def _bare_round(folder: Path, code: Path, calls: int, rows: Rows) -> None:
    with running_bare_server(folder, code) as endpoint:
        call_one_by_one(endpoint, 20)
        rows["bare uvicorn and engine"].append(call_one_by_one(endpoint, calls))


def _rie_round(code: Path, calls: int, rows: Rows) -> None:
    with running_rie(code, "app.handler") as endpoint:
        call_one_by_one(endpoint, 20)
        rows["AWS RIE"].append(call_one_by_one(endpoint, calls))
        rows[f"AWS RIE, {PARALLEL} clients"].append(call_in_parallel(endpoint, PARALLEL, 10))


def _show(rows: Rows, more: dict[str, list[float]]) -> None:
    print(f"{'':40}{'p50 ms':>26}{'p99 ms':>26}{'calls/s':>24}{'failed':>8}")
    for name, rounds in rows.items():
        p50, p99 = (spread([part(calls) for calls in rounds]) for part in (_p50, _p99))
        rate = spread([calls.per_s for calls in rounds], 0)
        print(f"{name:40}{p50:>26}{p99:>26}{rate:>24}{sum(calls.failed for calls in rounds):>8}")
    print()
    for name, values in more.items():
        print(f"{name:40}{spread(values, 1):>26}")
    print()


def _p50(calls: Calls) -> float:
    return calls.p50_ms


def _p99(calls: Calls) -> float:
    return calls.p99_ms


def _goals(rows: Rows, more: dict[str, list[float]]) -> bool:
    """Print each goal and what was seen; whether all hold."""

    def of(name: str, part: str) -> float:
        return median([float(getattr(calls, part)) for calls in rows[name]])

    one, many = rows["engine, one caller"], rows[f"gateway, Invoke, {PARALLEL} clients"]
    rie, rie_many = rows.get("AWS RIE", []), rows.get(f"AWS RIE, {PARALLEL} clients", [])
    note("p50 of a warm call", [calls.p50_ms for calls in one])
    note("p50 of a bare echo of JSON", [calls.p50_ms for calls in rows["bare echo of JSON"]])
    note("one worker", [calls.per_s for calls in rows["engine, 1 worker"]])
    note("cold start by exec", more["cold, exec ms"])
    note("cold bare interpreter with AWS's client", more["cold, bare interpreter with AWS's client ms"])
    note("cold start by the fork server", more["cold, fork server ms"])
    note("failures with 16 clients", [c.failed for c in many], peer=[c.failed for c in rie_many])
    note("p99, engine", [calls.p99_ms for calls in one], peer=[calls.p99_ms for calls in rie])
    ways = {"engine": one, "gateway": rows["gateway, Invoke"], "gateway, audited REST": rows["gateway, REST"]}
    ways["bare uvicorn and engine"] = rows["bare uvicorn and engine"]
    for name, ours in ways.items():
        if rie:
            note(f"p99, AWS RIE ÷ {name}", [a.p99_ms / b.p99_ms for a, b in zip(rie, ours, strict=True)])
    found = [
        ("p50 of a warm call at most 0.3 ms", of("engine, one caller", "p50_ms"), 0.3, False),
        ("one worker: at least 5,000 calls/s", of("engine, 1 worker", "per_s"), 5000.0, True),
        ("cold start by exec at most 60 ms", median(more["cold, exec ms"]), 60.0, False),
        ("cold start by the fork server at most 12 ms", median(more["cold, fork server ms"]), 12.0, False),
        (
            "no failure with 16 clients",
            float(sum(c.failed for c in many)),
            0,
            False,
        ),
    ]
    if "AWS RIE" in rows:
        for row, least in (("engine, one caller", 3.0), ("gateway, Invoke", 2.0)):
            ratio = median([rie.p99_ms / own.p99_ms for rie, own in zip(rows["AWS RIE"], rows[row], strict=True)])
            found.append((f"p99 of {row}: at least {least:g} times better than RIE", ratio, least, True))
    good = True
    for text, value, goal, least in found:
        held = value >= goal if least else value <= goal
        good = good and held
        print(f"{'yes' if held else 'NO ':4}{text:60}{value:12.2f}")
    return good


def main(argv: Sequence[str] = ()) -> int:
    """Measure, print, compare with the goals."""
    parser = argparse.ArgumentParser(prog="python -m load_tests functions")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--calls", type=int, default=2000)
    parser.add_argument("--quick", action="store_true", help="2 rounds of 640 calls")
    chosen = parser.parse_args(argv)
    rounds, calls = (2, 640) if chosen.quick else (chosen.rounds, chosen.calls)
    rows: Rows = defaultdict(list)
    more: dict[str, list[float]] = defaultdict(list)
    level = "?"
    with tempfile.TemporaryDirectory() as folder, running_gateway(Path(folder)) as functions:
        code = Path(folder) / "code"
        code.mkdir(mode=0o755)
        Path(folder).chmod(0o755)
        (code / "app.py").write_text(HANDLER)
        for number in range(rounds):
            with asyncio.Runner(loop_factory=new_event_loop) as runner:
                level = runner.run(_engine_round(Path(folder) / "engine", code, calls, rows, more))
            _gateway_round(functions, calls, rows)
            _bare_round(Path(folder) / "bare", code, calls, rows)
            try:
                _rie_round(code, calls, rows)
            except HomeFailed as error:
                print(f"without AWS RIE: {error}", file=sys.stderr)
            print(f"round {number + 1} of {rounds}", file=sys.stderr, flush=True)
    _show(rows, more)
    good = _goals(rows, more)
    load = os.getloadavg()[0]
    print(f"\nsandbox {level}, {os.cpu_count()} cores, load of the last minute {load:.1f} (ours is 2 to 3)")
    return int(not good)
