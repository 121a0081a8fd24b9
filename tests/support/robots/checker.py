"""What a fault campaign must find in the store at its end: every accepted sample once, or declared lost.

Three witnesses are compared: the store's rows, gaps and watermarks; the robot's journal of what it accepted; and what
the outbox itself says it accepted last. Nothing here asks the gateway, only its database.
"""

from __future__ import annotations

import json
import sqlite3
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import zstandard
from mcap.reader import make_reader

from gateway.store.telemetry.chunks import decode
from metaros.link import BACKFILL_BIT, CHANNEL_MASK
from tests.support.robots.load_robot_samples import KINDS, LOST, Counters, number_in, payload, read_journal

__all__ = ["Stored", "Verdict", "check", "read_rows", "read_sqlite"]

Key = tuple[int, int]  # epoch, stream
METRIC = CHANNEL_MASK & ~CHANNEL_MASK  # the stream of metric rows, 0


class StoredBatch(NamedTuple):
    """A batch as the store has it."""

    key: Key
    first_seq: int
    payloads: list[bytes]


@dataclass(slots=True)
class Stored:
    """A robot's part of the store."""

    batches: list[StoredBatch] = field(default_factory=list)
    gaps: dict[Key, list[tuple[int, int, str]]] = field(default_factory=dict)
    watermarks: dict[Key, int] = field(default_factory=dict)
    metric_values: list[float] = field(default_factory=list)


@dataclass(slots=True)
class Verdict:
    """What the check found."""

    accepted: int = 0  # samples in the journal, without declared losses
    rows: int = 0
    declared: int = 0  # numbers in gaps
    lost: int = 0
    duplicate: int = 0
    wrong: int = 0
    unaccepted: int = 0  # given to the outbox, and gone with the process before its sync
    epochs: int = 0
    reasons: Counter[str] = field(default_factory=Counter)
    problems: list[str] = field(default_factory=list)

    @property
    def good(self) -> bool:
        """Whether the promise was kept."""
        return not (self.lost or self.duplicate or self.wrong)

    def blame(self, kind: str, count: int, text: str) -> None:
        """Something is not as promised."""
        if count:
            setattr(self, kind, getattr(self, kind) + count)
            self.problems.append(f"{kind}: {text}")

    def add(self, other: Verdict) -> None:
        """Sum up."""
        for name in ("accepted", "rows", "declared", "lost", "duplicate", "wrong", "unaccepted"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        self.epochs = max(self.epochs, other.epochs)
        self.reasons += other.reasons
        self.problems += other.problems


def unsigned(number: int) -> int:
    """SQL's signed 64 bits as an epoch."""
    return number + (1 << 64) if number < 0 else number


def read_sqlite(path: Path, robot: str = "robot") -> Stored:
    """Read a robot from the gateway's database, which nobody writes any more."""
    connection = sqlite3.connect(f"file:{path}?mode=ro", uri=True)
    connection.row_factory = sqlite3.Row
    try:
        return read_rows(lambda sql: connection.execute(sql, (robot,)), "?", path.parent)
    finally:
        connection.close()


def read_rows(query: Any, mark: str, data_dir: Path) -> Stored:
    """Read a robot through `query(sql)`, and its segments in the gateway's folder; rows answer by column name."""
    stored = Stored()
    of_robot = f"(SELECT robot FROM robots WHERE id = {mark})"
    for row in query(f"SELECT * FROM sample_batches WHERE robot = {of_robot} ORDER BY first_seq"):
        stored.batches.append(StoredBatch(key_of(row), int(row["first_seq"]), list(payloads_of(row))))
    runs = f"SELECT * FROM segment_runs JOIN segments USING (segment) WHERE segment_runs.robot = {of_robot}"
    stored.batches += read_segments(query(f"SELECT * FROM segments WHERE robot = {of_robot}"), query(runs), data_dir)
    for row in query(f"SELECT * FROM gaps WHERE robot = {of_robot} ORDER BY from_seq"):
        gap = (int(row["from_seq"]), int(row["to_seq"]), str(row["reason"]))
        stored.gaps.setdefault(key_of(row), []).append(gap)
    for row in query(f"SELECT * FROM streams WHERE robot = {of_robot}"):
        stored.watermarks[key_of(row)] = int(row["seq"])
    for table, where in (
        ("metric_batches", "robot ="),
        ("metric_chunks", "series IN (SELECT series FROM series WHERE robot ="),
    ):
        close = ")" if "(" in where else ""
        for row in query(f"SELECT * FROM {table} WHERE {where} {of_robot}{close}"):
            stored.metric_values += values_of(row)
    return stored


def read_segments(segments: Iterable[Any], runs: Iterable[Any], data_dir: Path) -> Iterator[StoredBatch]:
    """The runs of segments: the table says which samples there are, PyPI's own reader what they hold."""
    files: dict[str, dict[tuple[Key, int], bytes]] = {}
    for row in segments:
        samples = files[str(row["object"])] = {}
        with (data_dir / "objects" / str(row["object"])).open("rb") as file:
            for _, channel, message in make_reader(file, validate_crcs=True).iter_messages():
                key = (int(channel.metadata["epoch"]), int(channel.metadata["stream"]))
                samples[key, message.sequence] = message.data
        assert len(samples) == int(row["messages"]), f"{row['object']} holds {len(samples)} messages"
    for row in runs:
        samples, key, first = files[str(row["object"])], key_of(row), int(row["first_seq"])
        numbers = range(first, first + int(row["count"]))
        yield StoredBatch(key, first, [samples.pop((key, seq & 0xFFFFFFFF)) for seq in numbers])
    left = sum(map(len, files.values()))
    assert left == 0, f"{left} messages of segments are in no run"


def values_of(row: Any) -> list[float]:
    """The numbers of some metric rows, be they as they came or packed."""
    if "encoding" not in row.keys():  # noqa: SIM118 - sqlite3.Row
        return [float(value) for value in np.frombuffer(row["vals"], "<f8")]
    chunk = (int(row["encoding"]), int(row["count"]), bytes(row["stamps"]), bytes(row["vals"]))
    return [float(value) for value in decode([chunk])[1]]


def key_of(row: Any) -> Key:
    """(epoch, stream) of a row."""
    return unsigned(int(row["epoch"])), int(row["stream_id"])


def payloads_of(row: Any) -> Iterator[bytes]:
    """The samples of a batch."""
    data = bytes(row["payload"])
    if "compression" in row.keys() and row["compression"] not in ("", "none", 0, None):  # noqa: SIM118 - sqlite3.Row
        data = zstandard.ZstdDecompressor().decompress(data, max_output_size=64 << 20)
    start = 0
    for length in np.frombuffer(row["lengths"], "<u4").tolist():
        yield data[start : start + length]
        start += length


def check(stored: Stored, folder: Path, *, lives: int, copies: Iterable[Path] = ()) -> Verdict:
    """Compare the store with a robot's folder; `copies` are folders of clones, whose epochs may have changed."""
    verdict = Verdict()
    copies = tuple(copies)
    numbers = check_rows(stored, verdict)
    check_metrics(stored, verdict)
    if not copies:
        check_ranges(stored, numbers, json.loads((folder / "final.json").read_text()), verdict)
        check_journal(stored, numbers, folder / "journal", verdict)
    check_contents(stored, numbers, [folder, *copies], verdict)
    verdict.epochs = len({epoch for epoch, _ in stored.watermarks})
    verdict.rows = sum(map(len, numbers.values())) + len(stored.metric_values)
    for gaps in stored.gaps.values():
        for first, last, reason in gaps:
            verdict.declared += last - first + 1
            verdict.reasons[reason] += last - first + 1
    counters = [Counters(folder / "counters", life=life) for life in range(lives)]
    verdict.unaccepted = sum(page[kind] for page in counters for kind in KINDS) - verdict.rows - verdict.declared
    for page in counters:
        page.close()
    return verdict


def check_rows(stored: Stored, verdict: Verdict) -> dict[Key, dict[int, int]]:
    """Every row's number by its identity; identities and contents are there once, payloads are what they were."""
    found: dict[Key, dict[int, int]] = {}
    seen: set[tuple[int, int]] = set()
    for batch in stored.batches:
        rows = found.setdefault(batch.key, {})
        for seq, data in enumerate(batch.payloads, batch.first_seq):
            number = number_in(data)
            kind = data[8] if len(data) > 8 else 99
            verdict.blame("wrong", data != payload(kind, number), f"{batch.key} {seq} has another content")
            verdict.blame("duplicate", seq in rows, f"{batch.key} {seq} is stored twice")
            verdict.blame("duplicate", (kind, number) in seen, f"sample {number:x} is stored twice, also as {seq}")
            seen.add((kind, number))
            rows[seq] = number
    for key, rows in found.items():
        ordered = [rows[seq] for seq in sorted(rows)]
        verdict.blame("wrong", ordered != sorted(ordered), f"{key} is out of order")
    return found


def check_metrics(stored: Stored, verdict: Verdict) -> None:
    """Metric rows have no identity of their own in the store: their contents and their count must be right."""
    twice = len(stored.metric_values) - len(set(stored.metric_values))
    verdict.blame("duplicate", twice, f"{twice} metric rows are stored twice")


def check_ranges(stored: Stored, numbers: dict[Key, dict[int, int]], final: Any, verdict: Verdict) -> None:
    """Rows and gaps are base + 1 … last accepted, disjoint, for every stream that the outbox still names."""
    metric_rows = 0
    bases = {(held["epoch"], held["stream_id"]): held["base_seq"] for held in final["ranges"]}
    lasts = {(held["epoch"], held["stream_id"]): held["last_seq"] for held in final["ranges"]}
    for key in {*lasts, *stored.watermarks}:
        last = lasts.get(key, stored.watermarks.get(key, 0))
        verdict.blame(
            "lost",
            last != stored.watermarks.get(key, 0),
            f"{key}: accepted {last}, stored {stored.watermarks.get(key)}",
        )
        covered = np.zeros(last + 1, np.uint8)
        covered[: bases.get(key, 0) + 1] = 1
        for first, to, _ in stored.gaps.get(key, ()):
            covered[first : to + 1] += 1
        if key[1] & CHANNEL_MASK == METRIC:
            metric_rows += int((covered == 0).sum())
            verdict.blame("wrong", int((covered > 1).sum()), f"{key}: gaps overlap")
            continue
        covered[[seq for seq in numbers.get(key, ()) if seq <= last]] += 1
        beyond = sum(seq > last for seq in numbers.get(key, ()))
        missing, twice = np.flatnonzero(covered == 0), np.flatnonzero(covered > 1)
        verdict.blame("lost", len(missing), f"{key}: {missing[:5]} … of {last} neither stored nor declared")
        verdict.blame("wrong", len(twice) + beyond, f"{key}: {twice[:5]} stored and declared, {beyond} beyond {last}")
    missing_rows = metric_rows - len(stored.metric_values)
    verdict.blame("lost" if missing_rows > 0 else "wrong", abs(missing_rows), f"{missing_rows} metric rows missing")


def check_journal(stored: Stored, numbers: dict[Key, dict[int, int]], path: Path, verdict: Verdict) -> None:
    """Every accepted sample is stored under the very number it was given, or that number is declared lost."""
    gaps = {key: set_of(spans) for key, spans in stored.gaps.items()}
    values = {int(value) for value in stored.metric_values}
    for entry in read_journal(path):
        key = (entry.epoch, entry.stream_id)
        rows, lost = numbers.get(key, {}), gaps.get(key, set())
        metric = entry.stream_id & CHANNEL_MASK == METRIC
        for offset in range(entry.count):
            seq, number = entry.first_seq + offset, entry.first_number + offset
            if entry.first_number == LOST:
                verdict.blame("wrong", seq not in lost, f"{key} {seq} was given up, and is not declared")
                continue
            verdict.accepted += 1
            if seq in lost:
                continue
            there = number in values if metric else rows.get(seq) == number
            kind = "wrong" if seq in rows else "lost"
            verdict.blame(kind, not there, f"{key} {seq}: sample {number:x} was accepted, stored is {rows.get(seq)}")


def check_contents(stored: Stored, numbers: dict[Key, dict[int, int]], folders: list[Path], verdict: Verdict) -> None:
    """With several outboxes or epochs: every accepted sample is stored, under whatever identity, or counted as lost."""
    if len(folders) == 1:
        return
    there: dict[bool, set[int]] = {True: {int(value) for value in stored.metric_values}, False: set()}
    for rows in numbers.values():
        there[False].update(rows.values())
    declared = sum(last - first + 1 for spans in stored.gaps.values() for first, last, _ in spans)
    missing = 0
    for folder in folders:
        for entry in read_journal(folder / "journal"):
            if entry.first_number == LOST:
                continue
            known = there[entry.stream_id & ~BACKFILL_BIT == METRIC]
            verdict.accepted += entry.count
            missing += sum(entry.first_number + offset not in known for offset in range(entry.count))
    verdict.blame("lost", max(0, missing - declared), f"{missing} accepted samples are not stored, {declared} declared")


def set_of(spans: list[tuple[int, int, str]]) -> set[int]:
    """All numbers of some gaps."""
    return {seq for first, last, _ in spans for seq in range(first, last + 1)}
