"""Ranges of stored series: 24 h in 1000 buckets out of ten million rows, and the same as a line (LTTB), p50 and p95.

Beside them is how long the buckets take of a store that has no levels yet: one of an earlier program, for its first
minutes.

    python -m load_tests history [--rows 10000000] [--queries 60] [--engines sqlite,postgres] [--quick]

Two readings of "ten million rows": one series that holds all of them, and a hundred series that share them. Values are
a random walk in doubles, which hardly compresses; stamps jitter by a tenth of their distance. Chunks are made by the
store's own encoder and inserted in bulk, interleaved as the merge leaves them; beside them rows wait for the merge, as
they always do. Levels are those that the gateway makes once a minute of what is ten minutes old. Every query begins at
another moment; the first few warm the caches and do not count. Measured is what a request waits for: SQL, decoding and
the buckets, not HTTP. PostgreSQL runs with its default settings.

1 is returned when a p95 of the buckets is above `--limit-ms`.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from gateway.store.engine import StoreEngine, placeholders
from gateway.store.engines import open_engine
from gateway.store.schema import CHUNK_SAMPLES
from gateway.store.telemetry.chunks import EncodedChunk
from gateway.store.telemetry.encode import encode
from gateway.store.telemetry.levels import SETTLED_NS, LevelBuilder
from gateway.store.telemetry.series import Method, read_range
from load_tests.figures import note
from tests.support.servers.postgres import PostgresServer

__all__ = ["Figures", "fill", "main", "measure"]

DAY_NS = 86_400 * 10**9
START_NS = 1_790_000_000 * 10**9
SHAPES = {"one": 1, "hundred": 100}
WARM = 3
INSERT_ROWS = 500
WAITING_BATCHES, BATCH_ROWS = 250, 500
_COLUMNS = tuple(item.name for item in fields(EncodedChunk))


@dataclass(frozen=True, slots=True)
class Figures:
    """Times of one kind of query in milliseconds."""

    p50: float
    p95: float
    points: int


def fill(engine: StoreEngine, *, rows: int, series: int) -> None:
    """A robot `r1` with series `s1`… over one day."""
    with engine.transaction(write=True):
        robot = "INSERT INTO robots (id, namespace, hostname, agent_version, labels, first_seen_ns, last_seen_ns)"
        engine.execute(f"{robot} VALUES ('r1', '/r1', '', '', '{{}}', 1, 1)")
        names = [(f"s{number}",) for number in range(1, series + 1)]
        engine.many("INSERT INTO series (robot, name, topic, field) VALUES (1, ?, '/t', 'f')", names)
    insert = (
        f"INSERT INTO metric_chunks ({', '.join(_COLUMNS)}, stored_ns, series)"
        f" VALUES ({placeholders(len(_COLUMNS) + 2)})"
    )
    made: list[tuple[Any, ...]] = []
    for row in _chunks(rows // series, series):
        made.append(row)
        if len(made) == INSERT_ROWS:
            _insert(engine, insert, made)
            made = []
    _insert(engine, insert, made)
    _insert(
        engine,
        "INSERT INTO metric_batches (robot, count, stored_ns, series, stamps, vals) VALUES (?, ?, ?, ?, ?, ?)",
        list(_batches(series)),
    )


def make_levels(engine: StoreEngine) -> tuple[float, float]:
    """As the gateway does; seconds of this process's CPU that it took, and bytes."""
    builder, began_s = LevelBuilder(engine, now_ns=START_NS + 2 * DAY_NS + SETTLED_NS), time.process_time()
    while builder.step():
        pass
    took_s = time.process_time() - began_s
    with engine.transaction(write=False):
        (size_bytes,) = engine.fetch("SELECT coalesce(sum(length(cells)), 0) FROM metric_levels")[0]
    return took_s, float(size_bytes)


def _insert(engine: StoreEngine, statement: str, rows: list[tuple[Any, ...]]) -> None:
    with engine.transaction(write=True):
        engine.many(statement, rows)


def _chunks(rows: int, series: int) -> Iterator[tuple[Any, ...]]:
    rng = np.random.default_rng(2)
    step_ns = DAY_NS // rows
    values = np.cumsum(rng.normal(size=rows))
    stamps = START_NS + np.arange(rows, dtype=np.int64) * step_ns + rng.integers(0, max(1, step_ns // 10), rows)
    for first in range(0, rows, CHUNK_SAMPLES):
        piece = slice(first, first + CHUNK_SAMPLES)
        for number in range(1, series + 1):
            chunk = encode(stamps[piece], values[piece] + number, closed=True)
            yield (*astuple(chunk), chunk.last_ns, number)


def _batches(series: int) -> Iterator[tuple[Any, ...]]:
    rng = np.random.default_rng(3)
    for number in range(WAITING_BATCHES):
        owners = rng.integers(1, series + 1, BATCH_ROWS, dtype=np.uint32)
        stamps = START_NS + DAY_NS + np.arange(BATCH_ROWS, dtype=np.int64) * 1000 + number * 1_000_000
        yield 1, BATCH_ROWS, 1, owners.tobytes(), stamps.tobytes(), rng.normal(size=BATCH_ROWS).tobytes()


def measure(engine: StoreEngine, *, queries: int, points: int, method: Method) -> Figures:
    """That many queries of 24 h, each from another moment on."""
    rng = np.random.default_rng(4)
    times, given = [], 0
    for number in range(WARM + queries):
        start_ns = START_NS + int(rng.integers(-600, 600)) * 10**9 + int(rng.integers(10**9))
        begin_s = time.perf_counter()
        (piece,) = read_range(
            engine, "r1", ["s1"], start_ns=start_ns, end_ns=start_ns + DAY_NS, points=points, method=method
        )
        if number >= WARM:
            times.append((time.perf_counter() - begin_s) * 1e3)
            given = len(piece.count)
    return Figures(statistics.median(times), float(np.percentile(times, 95)), given)


def _filled(options: argparse.Namespace, kind: str, folder: Path, *, series: int) -> StoreEngine:
    """A store of its own, as it is when autovacuum has seen it."""
    url = "" if kind == "sqlite" else options.server().schema()
    engine = open_engine(url, folder)[0]
    fill(engine, rows=options.rows, series=series)
    if url:
        options.server().ask("VACUUM ANALYZE metric_chunks, metric_levels", url=url)
    return engine


def _run(options: argparse.Namespace, folder: Path) -> float:
    """Every engine and shape; the worst p95 of the buckets."""
    worst = 0.0
    head = f"{'engine':<10}{'series':>7}{'rows each':>12}{'B/row':>7}  {'method':<9}"
    print(f"{head}{'points':>7}{'p50 ms':>9}{'p95 ms':>9}")
    for kind in options.engines.split(","):
        for shape in options.shapes.split(","):
            place = folder / f"{kind}-{shape}"
            place.mkdir()
            engine = _filled(options, kind, place, series=SHAPES[shape])
            used = engine.used_bytes() / options.rows
            reader = engine.reader()
            rows: tuple[tuple[str, Method], ...] = (("no levels", "buckets"), ("buckets", "buckets"), ("lttb", "lttb"))
            for title, method in rows:
                if title == "buckets":
                    levels_s, levels_bytes = make_levels(engine)
                found = measure(reader, queries=options.queries, points=options.points, method=method)
                if title == "buckets":
                    worst = max(worst, found.p95)
                    note(f"p95 of a day in 1000 buckets, {kind}, {shape}", [found.p95])
                print(
                    f"{kind:<10}{SHAPES[shape]:>7}{options.rows // SHAPES[shape]:>12,}{used:>7.1f}  {title:<9}"
                    f"{found.points:>7}{found.p50:>9.1f}{found.p95:>9.1f}",
                    flush=True,
                )
            print(f"  levels: {levels_s / options.rows * 1e9:.0f} ns and {levels_bytes / options.rows:.3f} B a row")
            reader.close()
            engine.close()
    return worst


def main(argv: Sequence[str] = ()) -> int:
    """Print the table; 1 when the buckets took too long."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--rows", type=int, default=10_000_000)
    parser.add_argument("--queries", type=int, default=60)
    parser.add_argument("--points", type=int, default=1000)
    parser.add_argument("--engines", default="sqlite,postgres")
    parser.add_argument("--shapes", default=",".join(SHAPES))
    parser.add_argument("--limit-ms", type=float, default=25.0, help="what p95 of the buckets may be")
    parser.add_argument("--quick", action="store_true", help="few rows and queries: that it works, not how fast")
    options = parser.parse_args(list(argv))
    if options.quick:
        options.rows, options.queries, options.limit_ms = 120_000, 1, float("inf")
    servers: list[PostgresServer] = []

    def server() -> PostgresServer:
        if not servers:
            servers.append(PostgresServer("-c", "shared_buffers=128MB", durable=not options.quick))
            servers[0].start()
        return servers[0]

    options.server = server
    try:
        with tempfile.TemporaryDirectory() as folder:
            worst = _run(options, Path(folder))
    finally:
        for started in servers:
            started.close()
    load = os.getloadavg()[0]
    print(f"{options.queries} queries each; {os.cpu_count()} cores, load of the last minute {load:.1f} (ours is 1)")
    return int(worst > options.limit_ms)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
