"""Publish and receive against raw eclipse-zenoh, between two processes over loopback, peer to peer.

    python -m load_tests pubsub [--rounds 5] [--seconds 1.0] [--sizes 64,1024,65536,1048576]

Raw is `put(bytes)` with an attachment of 33 bytes to `payload.to_bytes()` in eclipse-zenoh's default callback. Typed is
`publish(message)` (encode, attachment) to a callback that gets the decoded message with its sequence checked: `shared`
on the executor, `dedicated` on a thread of its own; `bytes` is `publish(cdr)` to a dedicated `raw=True` one. With `shm`
both ends have shared memory, raw by Zenoh's own optimisation. All publish flat out, reliable and keep-all, so that
nothing is lost; counted is what reaches the callback. Round trips are one message there and back at a time, with the
default profile. Rounds are interleaved; figures are medians over the rounds, CPU is user and system time of a whole
process per message.
"""

from __future__ import annotations

import argparse
import json
import os
import socket
import statistics
import subprocess
import sys
from collections.abc import Sequence
from typing import Any, NamedTuple

from load_tests.figures import note

__all__ = ["main", "run"]

PATHS = ("raw", "shared", "dedicated", "bytes")
SIZES = (64, 1024, 65536, 1048576)
_SHARED_FROM = 65536
_PATIENCE_S = 30.0


class Row(NamedTuple):
    """What is measured."""

    size: int
    path: str
    shm: bool
    trips: bool = False


def rows_of(sizes: Sequence[int], paths: Sequence[str]) -> list[Row]:
    """Every row of the table: throughput of all sizes, then round trips of the smallest."""
    flows = [Row(size, path, shm) for size in sizes for shm in (False, True) for path in paths]
    kept = [row for row in flows if not row.shm or row.size >= _SHARED_FROM]
    return kept + [Row(min(sizes), path, False, True) for path in paths if path != "bytes"]


def run(rows: Sequence[Row], *, rounds: int, seconds: float) -> dict[Row, list[dict[str, float]]]:
    """The figures of every row, one a round."""
    figures: dict[Row, list[dict[str, float]]] = {row: [] for row in rows}
    for _ in range(rounds):
        for row in rows:
            figures[row].append(_once(row, seconds))
    return figures


def _once(row: Row, seconds: float) -> dict[str, float]:
    """Two processes, linked directly."""
    command = [
        sys.executable,
        "-m",
        "load_tests.benchmarks.library.pubsub_processes",
        "--path",
        row.path,
        "--size",
        str(row.size),
    ]
    command += ["--seconds", str(seconds), "--endpoint", _free_endpoint(), *(["--shm"] if row.shm else [])]
    pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    roles = ("echo", "ping") if row.trips else ("count", "flood")
    with subprocess.Popen([*command, "--role", roles[0]], **pipes) as there:
        assert there.stdout is not None
        there.stdout.readline()
        with subprocess.Popen([*command, "--role", roles[1]], **pipes) as here:
            try:
                if row.trips:
                    return dict(json.loads(here.communicate(timeout=_PATIENCE_S + seconds)[0]))
                figures = dict(json.loads(there.stdout.readline()))
                sent = json.loads(here.communicate("stop\n", timeout=_PATIENCE_S)[0])
                return figures | {"sender_cpu_us": sent["cpu_us"]}
            finally:
                here.kill()
                there.kill()


def _free_endpoint() -> str:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{listener.getsockname()[1]}"


def _median(figures: Sequence[dict[str, float]], name: str) -> float:
    return statistics.median(figure[name] for figure in figures)


def _print_flow(row: Row, figures: Sequence[dict[str, float]], raw: Sequence[dict[str, float]] | None) -> None:
    rates = [figure["rate"] for figure in figures]
    spread = f"{min(rates):,.0f}..{max(rates):,.0f}"
    ratio = statistics.median(rates) / _median(raw, "rate") if raw else float("nan")
    cpu = f"{_median(figures, 'sender_cpu_us'):.1f}+{_median(figures, 'cpu_us'):.1f}"
    name = f"{row.path}{' shm' if row.shm else ''}"
    left = f"{row.size:>8}  {name:<14}{statistics.median(rates):>12,.0f}{spread:>22}"
    print(f"{left}{ratio:>8.2f}{cpu:>16}{_median(figures, 'threads'):>9.0f}")


def _note(results: dict[Row, list[dict[str, float]]]) -> None:
    raw, own = (results.get(Row(64, path, False)) for path in ("raw", "dedicated"))
    if raw and own:
        rates, bare = ([figure["rate"] for figure in figures] for figures in (own, raw))
        note("typed 64 B, dedicated", rates, peer=bare)
        note("typed 64 B, of raw", [mine / least for mine, least in zip(rates, bare, strict=True)])


def main(argv: Sequence[str] = ()) -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--rounds", type=int, default=5, help="interleaved rounds")
    parser.add_argument("--seconds", type=float, default=1.0, help="measured time a round and row")
    parser.add_argument("--sizes", default=",".join(map(str, SIZES)), help="payload sizes in bytes")
    parser.add_argument("--paths", default=",".join(PATHS), help="which paths")
    options = parser.parse_args(list(argv))
    rows = rows_of([int(size) for size in options.sizes.split(",")], options.paths.split(","))
    results = run(rows, rounds=options.rounds, seconds=options.seconds)
    print(f"{'bytes':>8}  {'path':<14}{'recv/s':>12}{'min..max':>22}{'to raw':>8}{'CPU us, pub+sub':>16}{'threads':>9}")
    for row in rows:
        if not row.trips:
            _print_flow(row, results[row], results.get(Row(row.size, "raw", False)))
    _note(results)
    print(f"\n{'bytes':>8}  {'path':<14}{'RTT p50 us':>12}{'p99 us':>10}{'p50 to raw':>12}")
    for row in rows:
        if row.trips:
            p50, p99 = _median(results[row], "p50_us"), _median(results[row], "p99_us")
            raw = results.get(row._replace(path="raw"))
            ratio = p50 / _median(raw, "p50_us") if raw else float("nan")
            print(f"{row.size:>8}  {row.path:<14}{p50:>12.0f}{p99:>10.0f}{ratio:>12.2f}")
    print(
        f"\nmedians of {options.rounds} interleaved rounds on {os.cpu_count()} cores; `to raw` is against raw, no shm"
    )
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
