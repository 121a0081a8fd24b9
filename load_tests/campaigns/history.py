"""kill -9 of a gateway that compacts, purges and exports all the time: every sample once, and no object is left over.

A robot sends without an end; the gateway makes segments of 48 KiB as fast as it can, and in every second leg the
retention deletes the oldest bulk messages at once. Meanwhile somebody exports. After a leg all is drained and the
gateway started once more: what it exports must be what its database and its segments hold, and those are compared with
the robot's journal. Of what retention deletes, only the oldest may be gone, without a hole.

    python -m load_tests.campaigns history [--postgres] [--cycles 200] [--leg 50] [--tick-ms 5] [--seed N] [--keep]
"""

from __future__ import annotations

import contextlib
import http.client
import io
import json
import signal
import threading
import time
from collections import Counter
from functools import partial
from pathlib import Path
from random import Random
from typing import Any
from urllib.parse import urlencode

from mcap.reader import make_reader

from gateway.store.engines import open_engine
from gateway.store.integrity.check import check as store_check
from gateway.store.ledger import LEASE_S, in_transaction, sweep_objects
from gateway.store.objects import DirectoryStore
from load_tests.campaigns.kills import parser, run_legs
from metaros.clock import SystemClock
from metaros.errors import MetarosError
from metaros.link import CHANNEL_MASK
from tests.support.robots.checker import Stored, Verdict, check, read_rows
from tests.support.robots.load_robot_stack import LoadStack
from tests.support.servers.postgres import PostgresServer
from tests.support.waiting import wait_until

__all__ = ["HistoryStack", "main"]

ACTS = (("kill compacting", 6), ("kill exporting", 4), ("kill starting", 2), ("stop gateway", 1))
DRAIN_S = 240.0  # a gateway that does all this at once answers late, and back-fill takes that for a slow network
KEPT_S = 0.5  # of what the robot makes, at 200 KiB/s with a tick of 5 ms
SAMPLE_BYTES = 200
ENOUGH = 12  # so many times what is kept: segments, of which retention counts the bytes, take a ninth of the samples


class HistoryStack(LoadStack):
    """A robot, and a gateway that is busy with its store."""

    legs = 0

    def __init__(self, folder: Path, url: str = "", *, tick_s: float = 0.005) -> None:
        HistoryStack.legs += 1
        self.purged = HistoryStack.legs % 2 == 0
        self.kept_bytes = round(KEPT_S * 1024 / tick_s)
        rules = (f"bulk=,{self.kept_bytes / 1024:.1f}KiB",) if self.purged else ()
        gateway = {"busy": True, "retention_rules": rules, "store_url": url}
        super().__init__(folder, robot={"drain_s": DRAIN_S, "tick_s": tick_s}, gateway=gateway)
        self.objects = DirectoryStore(self.gateway_config.data_dir / "objects")

    def export(self, timeout_s: float = 60.0) -> bytes:
        """All that the gateway has, as a file; OSError or HTTPException when it dies."""
        address = (self.gateway_config.host, self.gateway_config.http_port)
        with contextlib.closing(http.client.HTTPConnection(*address, timeout=timeout_s)) as connection:
            query = urlencode({"robot": self.robot_config.name, "start": "-1d", "end": "now"})
            connection.request("GET", f"/api/v1/export.mcap?{query}")
            answer = connection.getresponse()
            data = answer.read()
        if answer.status != 200:
            raise OSError(f"{answer.status} {data[:200]!r}")
        return data

    def check(self) -> Verdict:
        """End well, start again, export, and compare everything with everything."""
        if self.purged:
            wait_until(lambda: self.given() * SAMPLE_BYTES > ENOUGH * self.kept_bytes)
        self.end(timeout_s=DRAIN_S + 30)
        stored, verdict = self.stored(), Verdict()
        had_purged = self.has_purged()
        self.start("gateway")
        wait_until(self.answers)
        self.check_export(stored, verdict)
        wait_until(lambda: any(self.objects.names()))  # no life before may have been long enough to compact anything
        if self.purged and not had_purged:
            there = sum(len(batch.payloads) for batch in stored.batches)
            wait_until(lambda: self.exported().total() < there, every_s=0.1)
        self.signal("gateway", signal.SIGTERM)
        self.processes["gateway"].join(60)
        self.kill("gateway")
        stored = self.stored()
        if self.purged:
            declare_purged(stored, json.loads((self.folder / "final.json").read_text()))
        verdict.add(check(stored, self.folder, lives=self.lives))
        self.check_objects(verdict)
        return verdict

    def given(self) -> int:
        """How many samples of the purged kind there have been."""
        return sum(self.page(life)["bulk"] for life in range(self.lives))

    def has_purged(self) -> bool:
        """Whether retention has deleted anything; a leg where it never does would say nothing about it."""
        stored = self.stored()
        declare_purged(stored, json.loads((self.folder / "final.json").read_text()))
        return any(why == "purged" for spans in stored.gaps.values() for _, _, why in spans)

    def answers(self) -> bool:
        """Whether the gateway can be asked."""
        try:
            return bool(self.export())
        except (OSError, http.client.HTTPException):
            return False

    def exported(self) -> Counter[bytes]:
        """What an export has, and how often."""
        reader = make_reader(io.BytesIO(self.export()), validate_crcs=True)
        return Counter(message.data for _, _, message in reader.iter_messages())

    def check_export(self, stored: Stored, verdict: Verdict) -> None:
        """What is exported is what is stored; of what may be purged meanwhile, nothing else."""
        exported = self.exported()
        there = Counter(data for batch in stored.batches for data in batch.payloads)
        verdict.blame("duplicate", sum((exported - there).values()), "an export has what is not stored so often")
        if not self.purged:
            verdict.blame("lost", sum((there - exported).values()), "an export lacks what is stored")

    def check_objects(self, verdict: Verdict) -> None:
        """After every lease is over, the object store holds what the ledger says, and segments are what it says."""
        engine, _ = open_engine(self.gateway_config.store_url, self.gateway_config.data_dir)
        try:
            now_ns = SystemClock().wall_ns()
            for leases in (2, 4):
                sweep_objects(in_transaction(engine), self.objects, now_ns=now_ns + round(leases * LEASE_S * 1e9))
            report = store_check(engine, self.objects, deep=True, now_ns=now_ns)
            with engine.transaction(write=False):
                known = {str(row[0]): str(row[1]) for row in engine.fetch("SELECT name, kind FROM objects")}
                segments = {str(row[0]) for row in engine.fetch("SELECT object FROM segments")}
        finally:
            engine.close()
        for found in (*report.damage, *report.orphans):
            verdict.blame("wrong", 1, f"store check: {found}")
        there = {info.name for info in self.objects.names()}
        files = {path for path in (self.gateway_config.data_dir / "objects").rglob("*") if path.is_file()}
        verdict.blame("wrong", len(there - known.keys()), f"orphans: {sorted(there - known.keys())[:3]}")
        verdict.blame("lost", len(known.keys() - there), f"missing: {sorted(known.keys() - there)[:3]}")
        leaked = {name for name, kind in known.items() if kind == "segment"} ^ segments
        verdict.blame("wrong", len(leaked), f"in the ledger or in segments alone: {sorted(leaked)[:3]}")
        verdict.blame("wrong", len(files) - len(there), "files beside the objects")
        verdict.blame("wrong", int(not segments), "nothing was compacted")


class PostgresHistoryStack(HistoryStack):
    """The same on a PostgreSQL of its own, which is killed, too."""

    may_end = ("gateway",)  # one that starts while there is no database; a supervisor starts it again

    def __init__(self, folder: Path, *, tick_s: float = 0.005) -> None:
        self.server = PostgresServer(durable=True)
        try:
            self.server.start()
            super().__init__(folder, self.server.url, tick_s=tick_s)
        except BaseException:
            self.server.close()
            raise

    def __exit__(self, *exc: object) -> None:
        try:
            super().__exit__(*exc)
        finally:
            self.server.close()

    def stored(self) -> Stored:
        """What the database and the segments have."""
        data_dir = self.gateway_config.data_dir
        return read_rows(lambda sql: self.server.ask(sql, self.robot_config.name), "$1", data_dir)


def declare_purged(stored: Stored, final: Any) -> None:
    """Count as given up what retention may have deleted: of a bulk stream, all before the first number that is left."""
    first: dict[tuple[int, int], int] = {}
    for batch in stored.batches:
        first[batch.key] = min(first.get(batch.key, batch.first_seq), batch.first_seq)
    bases = {(held["epoch"], held["stream_id"]): held["base_seq"] for held in final["ranges"]}
    for key, seq in stored.watermarks.items():
        if key[1] & CHANNEL_MASK == final["streams"]["bulk"]:
            last, base = first.get(key, seq + 1) - 1, bases.get(key, 0)
            stored.gaps[key] = [gap for gap in stored.gaps.get(key, []) if gap[0] > last]
            if last > base:
                stored.gaps[key].append((base + 1, last, "purged"))


def break_one(stack: LoadStack, rng: Random, act: str) -> None:
    """kill -9 at some moment of the act; then it runs again."""
    assert isinstance(stack, HistoryStack)
    if act == "kill postgres":
        assert isinstance(stack, PostgresHistoryStack)
        stack.server.kill()
        time.sleep(rng.uniform(0.0, 0.3))
        stack.server.start()
        return
    if act == "stop gateway":
        stack.signal("gateway", signal.SIGSTOP)
        time.sleep(rng.uniform(0.01, 0.3))
        stack.signal("gateway", signal.SIGCONT)
        return
    exporting = threading.Thread(target=export_quietly, args=(stack,), daemon=True)
    if act == "kill exporting":
        exporting.start()
    elif act == "kill starting":
        stack.kill("gateway")
        stack.start("gateway")
    time.sleep(rng.uniform(0.0, 0.4))
    stack.kill("gateway")
    stack.start("gateway")
    if act == "kill exporting":
        exporting.join()


def export_quietly(stack: HistoryStack) -> None:
    """An export that is cut."""
    with contextlib.suppress(OSError, http.client.HTTPException, MetarosError):
        stack.export(timeout_s=10)


def main(argv: list[str] | None = None) -> int:
    """Run the campaign; exit code 1 when a sample was lost, stored twice, or wrong, or an object is left over."""
    made = parser(__doc__, cycles=200)
    made.set_defaults(leg=50)
    made.add_argument("--postgres", action="store_true", help="on PostgreSQL, which is killed, too")
    options = made.parse_args(argv)
    make = partial(PostgresHistoryStack if options.postgres else HistoryStack, tick_s=options.tick_ms / 1e3)
    if not options.postgres:
        return run_legs(options, make, name="history", acts=ACTS, act_on=break_one)
    acts = (*ACTS, ("kill postgres", 5))
    return run_legs(options, make, name="history --postgres", acts=acts, act_on=break_one)


if __name__ == "__main__":
    raise SystemExit(main())
