"""Service round trips and action goals against raw eclipse-zenoh queries, between two processes over loopback.

    python -m load_tests service [--rounds 5] [--seconds 1.0]

Raw is `session.get(payload)` to a default-callback queryable that replies with bytes of the same size, without
attachments, decoding or a graph. Ours is `client.call(AddTwoInts.Request)` to a service on the default executor, and
the same with 32 coroutines at a time. A goal is sent, accepted, executed by a plain `execute` and its result awaited,
one after the other and 32 at a time. Both sessions are linked directly. Rounds are interleaved; the figures are
medians over the rounds.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import socket
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Awaitable, Callable, Sequence
from typing import Any, NamedTuple

import zenoh

import metaros
from load_tests.figures import note
from metaros.cdr import codec
from metaros.interfaces.example_interfaces.action import Fibonacci
from metaros.interfaces.example_interfaces.srv import AddTwoInts

__all__ = ["main", "run"]

MODES = ("raw", "call", "call x32", "goal", "goal x32")
_KEY = "bench/raw"
_AT_ONCE = 32
_WARM_UP = 50
_READY = "ready"


class Figures(NamedTuple):
    """One row of one round."""

    p50_us: float
    p99_us: float
    per_s: float


def run(*, rounds: int, seconds: float) -> dict[str, list[Figures]]:
    """The figures of every mode, one entry a round."""
    figures: dict[str, list[Figures]] = {mode: [] for mode in MODES}
    for _ in range(rounds):
        for mode, rows in figures.items():
            rows.append(_once(mode, seconds))
    return figures


def _once(mode: str, seconds: float) -> Figures:
    """One server process and one client process."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{listener.getsockname()[1]}"
    command = [
        sys.executable,
        "-m",
        "load_tests.benchmarks.library.service",
        "--seconds",
        str(seconds),
        "--endpoint",
        endpoint,
    ]
    kind = mode.split(" ")[0]
    with subprocess.Popen([*command, "--serve", kind], stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        assert server.stdout.readline().strip() == _READY
        done = subprocess.run([*command, "--ask", mode], stdout=subprocess.PIPE, text=True, check=True)
        server.kill()
    return Figures(*(float(number) for number in done.stdout.split()))


def _plain_session(**endpoints: str) -> zenoh.Session:
    """As any program opens one: eclipse-zenoh's own defaults, except that nobody else is looked for."""
    config = zenoh.Config()
    config.insert_json5("scouting/multicast/enabled", "false")
    for name, endpoint in endpoints.items():
        config.insert_json5(f"{name}/endpoints", f'["{endpoint}"]')
    return zenoh.open(config)


# -- servers -----------------------------------------------------------------------------------------------------------


def _serve(kind: str, endpoint: str) -> None:
    """Until killed."""
    if kind == "raw":
        answer = codec(AddTwoInts.Response).encode(AddTwoInts.Response(sum=1))

        def reply(query: zenoh.Query) -> None:
            assert query.payload is not None
            query.payload.to_bytes()
            query.reply(_KEY, answer)
            query.drop()  # type: ignore[no-untyped-call]

        session = _plain_session(listen=endpoint)
        session.declare_queryable(_KEY, reply, complete=True)
        print(_READY, flush=True)
        threading.Event().wait()
    context = metaros.Context(domain_id=0, connect=[], listen=endpoint)
    node = metaros.Node("bench_server", context=context, enable_rosout=False)

    @node.service(AddTwoInts, "add")
    def add(request: Any, response: Any) -> None:
        response.sum = request.a + request.b

    node.create_action_server(Fibonacci, "fibonacci", lambda goal: Fibonacci.Result(sequence=[0, 1, 1]))
    print(_READY, flush=True)
    metaros.spin(node)


# -- clients -----------------------------------------------------------------------------------------------------------


def _ask(mode: str, endpoint: str, seconds: float) -> None:
    """Print p50, p99 and how many a second."""
    kind, _, at_once = mode.partition(" ")
    if kind == "raw":
        session, payload = _plain_session(connect=endpoint), codec(AddTwoInts.Request).encode(AddTwoInts.Request(a=1))

        def query() -> None:
            (reply,) = session.get(_KEY, payload=payload)
            reply.ok.payload.to_bytes()

        while not list(session.get(_KEY, payload=payload)):
            time.sleep(0.01)
        _report(_one_by_one(query, seconds))
    context = metaros.Context(domain_id=0, connect=endpoint, listen=[])
    node = metaros.Node("bench_client", context=context, enable_rosout=False)
    if kind == "call":
        client, request = node.create_client(AddTwoInts, "add"), AddTwoInts.Request(a=1, b=2)
        assert client.wait_for_service(10)
        if at_once:
            _report(asyncio.run(_side_by_side(lambda: client.call_async(request), seconds)))
        _report(_one_by_one(lambda: client.call(request), seconds))
    actions, goal = node.create_action_client(Fibonacci, "fibonacci"), Fibonacci.Goal(order=2)
    assert actions.wait_for_server(10)

    async def pursue() -> None:
        await (await actions.send_goal(goal)).result()

    if at_once:
        _report(asyncio.run(_side_by_side(pursue, seconds)))
    _report(_one_by_one(lambda: actions.send_goal(goal).wait().result().wait(), seconds))


def _one_by_one(ask: Callable[[], object], seconds: float) -> list[float]:
    """How long each took, in seconds; the total at the end."""
    for _ in range(_WARM_UP):
        ask()
    took: list[float] = []
    now = began = time.perf_counter()
    while now - began < seconds:
        before, _ = now, ask()
        now = time.perf_counter()
        took.append(now - before)
    return [*took, now - began]


async def _side_by_side(ask: Callable[[], Awaitable[object]], seconds: float) -> list[float]:
    """The same with several at a time."""
    took: list[float] = []
    await asyncio.gather(*(ask() for _ in range(_WARM_UP)))
    began = time.perf_counter()

    async def worker() -> None:
        while (before := time.perf_counter()) - began < seconds:
            await ask()
            took.append(time.perf_counter() - before)

    await asyncio.gather(*(worker() for _ in range(_AT_ONCE)))
    return [*took, time.perf_counter() - began]


def _report(took: list[float]) -> None:
    *each, total = took
    cuts = statistics.quantiles(each, n=100)
    print(cuts[49] * 1e6, cuts[98] * 1e6, len(each) / total, flush=True)
    os._exit(0)  # a measured session need not be taken down tidily


def main(argv: Sequence[str] = ()) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--rounds", type=int, default=5, help="interleaved rounds, at least 5")
    parser.add_argument("--seconds", type=float, default=1.0, help="measured time a round and row")
    parser.add_argument("--serve", help=argparse.SUPPRESS)
    parser.add_argument("--ask", help=argparse.SUPPRESS)
    parser.add_argument("--endpoint", default="", help=argparse.SUPPRESS)
    options = parser.parse_args(list(argv))
    if options.serve:
        _serve(options.serve, options.endpoint)
    if options.ask:
        _ask(options.ask, options.endpoint, options.seconds)
    rounds = max(5, options.rounds)
    figures = run(rounds=rounds, seconds=options.seconds)
    raw, call = ([row.p50_us for row in figures[mode]] for mode in ("raw", "call"))
    note("call p50", call, peer=raw)
    note("call p50, of raw", [ours / bare for ours, bare in zip(call, raw, strict=True)])
    note("goals a second, 32 at a time", [row.per_s for row in figures["goal x32"]])
    middle = {mode: Figures(*map(statistics.median, zip(*rows, strict=True))) for mode, rows in figures.items()}
    print(f"{'path':<10}{'p50 us':>10}{'p99 us':>10}{'per s':>10}{'min..max':>18}{'p50 to raw':>12}")
    for mode, rows in figures.items():
        rates = [row.per_s for row in rows]
        spread, ratio = f"{min(rates):,.0f}..{max(rates):,.0f}", middle[mode].p50_us / middle["raw"].p50_us
        p50, p99, per_s = middle[mode]
        print(f"{mode:<10}{p50:>10,.0f}{p99:>10,.0f}{per_s:>10,.0f}{spread:>18}{ratio:>12.2f}")
    print(f"medians of {rounds} interleaved rounds on {os.cpu_count()} cores")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
