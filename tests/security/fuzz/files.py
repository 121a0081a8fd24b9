"""Targets of files: MCAP, segments and series, the agent's outbox, black box and state, sealed payloads, old logs."""

from __future__ import annotations

import io
import json
import random  # noqa: TID251 - seeded
import struct
import tempfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from edge_agent.blackbox.mcap_reader import records
from edge_agent.blackbox.recording_store import RecordingStore, SavedRecording
from edge_agent.commands.executed_ids import CommandLog
from edge_agent.errors import CorruptError, DiskError
from edge_agent.link.byte_budget_override import stored_limit
from edge_agent.outbox import LOGS
from edge_agent.outbox.segment import Frame, Gap, Kind, SegmentHeader, pack_frame, pack_header, read_header, scan
from edge_agent.outbox.state import OutboxState
from gateway.errors import CorruptObjectError
from gateway.store.telemetry import chunks
from gateway.store.telemetry.encode import encode
from gateway.store.telemetry.segments import open_chunk, unpack
from metaros.clock import ManualClock
from metaros.errors import KeyringError, MetarosError, RecordingError, SealError
from metaros.idl import schema_text
from metaros.limits import LIMITS
from metaros.mcap import MalformedChunkError, McapFile, read_chunk, read_messages
from metaros.record.bag import open_bag
from metaros.record.bag_index import read_index
from metaros.record.carmen import LogCount, read_log
from metaros.record.qos_yaml import offered_qos, read_qos
from metaros.seal import Keyring, Opener, Origin, Sealer, SealKey
from metaros.wire.qos import qos_rosout
from tests.edge_agent.parts import accept, make_outbox
from tests.security.fuzz.target import MIB, Target
from tests.support.simulation.sim_disk import SimDisk

__all__ = ["TARGETS", "mcap_file"]

CLOCK = ManualClock()


def on_disk(data: bytes, run: Callable[[Path], Any], *, name: str = "fuzz.mcap", mode: int = 0o600) -> None:
    """Run on a file with these bytes, in a folder of its own."""
    with tempfile.TemporaryDirectory(prefix="metaros-fuzz-") as folder:
        path = Path(folder) / name
        path.write_bytes(data)
        path.chmod(mode)
        run(path)


def mcap_file(compression: str = "zstd", *, index: bool = True) -> bytes:
    """A recording of two topics, with metadata; without its index as a killed recorder leaves it."""
    output = io.BytesIO()
    file: McapFile[None] = McapFile(output, compression=compression, chunk_bytes=256)
    schema = file.add_schema("std_msgs/msg/String", schema_text("std_msgs/msg/String").encode())
    for topic in ("/a", "/b"):
        about = {"offered_qos_profiles": offered_qos([qos_rosout]), "topic_type_hash": "", "latched": "1"}
        channel = file.add_channel(topic, schema, about, encoding="cdr")
        for number in range(3):
            file.write(channel, number, number, number, b"\0\1\0\0\6\0\0\0hello\0", None)
    if index:
        file.finish(lambda: [("metaros.test", {"a": "b"})], lambda _notes: None)
    else:
        file.flush()
    return output.getvalue()


def bag(data: bytes) -> None:
    """What `metaros bag` does with a file that somebody sent."""

    def run(path: Path) -> None:
        found = open_bag(path)
        for message in found.messages():
            try:
                message.decode()
            except MetarosError:
                continue
        found.gaps()
        for topic in found.topics:
            assert topic.qos is not None

    on_disk(data, run)


def black_box(data: bytes) -> None:
    """What the agent does with a piece of its black box after a crash."""

    def run(path: Path) -> None:
        for record in records(read_index(path)):
            assert isinstance(record.payload, bytes)

    on_disk(data, run)


def chunk(data: bytes) -> None:
    """One chunk of a segment, as the gateway reads it; the bytes are the chunk record alone."""
    raw = read_chunk(data, most_bytes=MIB)
    list(read_messages(raw, 0, 3))


def chunk_record() -> bytes:
    """A chunk as it lies in a file."""
    output = io.BytesIO()
    file: McapFile[None] = McapFile(output, compression="zstd")
    channel = file.add_channel("/a", file.add_schema("std_msgs/msg/String", b"string data\n"), {}, encoding="cdr")
    for number in range(3):
        file.write(channel, number, number, number, b"payload" * 5, None)
    file.flush()
    start, size = file.last_chunk
    return output.getvalue()[start : start + size]


def segment_run(data: bytes) -> None:
    """The same, as history does it."""
    unpack(open_chunk(data), offset=0, first_seq=0, count=3)


def series(data: bytes) -> None:
    """A row of columns: encoding, count, length of the stamps' column, both columns."""
    if len(data) < 8:
        return
    encoding, count, stamps_bytes = struct.unpack_from("<BHI", data)
    rest = data[7:]
    stamps, values = chunks.decode([(encoding, count, rest[:stamps_bytes], rest[stamps_bytes:])])
    assert len(stamps) == len(values) == count


def series_seeds() -> tuple[bytes, ...]:
    """Columns in each form."""
    rng = np.random.default_rng(1)
    stamps = np.cumsum(rng.integers(1, 1000, 200)).astype(np.int64)
    made = [
        encode(np.arange(50, dtype=np.int64), np.full(50, 2.5)),
        encode(stamps, rng.normal(size=200)),
        encode(stamps, np.round(rng.normal(size=200)).astype(np.float32).astype(np.float64)),
    ]
    return tuple(
        struct.pack("<BHI", item.encoding, item.count, len(item.stamps)) + item.stamps + item.vals for item in made
    )


def log_bytes() -> bytes:
    """A segment of the outbox with every kind of frame."""
    header = pack_header(SegmentHeader(era=1, boot_id="b", last={2: 5}, until={2: 9}))
    frames = [
        Frame(Kind.SAMPLES, 2, 6, 2, 10, 20, b"columns" * 4),
        Frame(Kind.METRICS, 0, 1, 1, 10, 20, b"rows"),
        Frame.of_gap(2, Gap(8, 9, "quota", 1, 2), wall_ns=3, mono_ns=4),
    ]
    return header + b"".join(map(pack_frame, frames))


def log(data: bytes) -> None:
    """Header and frames; and the same with checksums made right, as whoever can write to the disk would."""
    for candidate in (data, summed(data)):
        try:
            _, start = read_header(candidate)
        except CorruptError:
            start = 0
        for frame in scan(candidate, start).frames:
            assert frame.last_seq >= frame.first_seq - 1 or frame.kind is Kind.GAP


def summed(data: bytes) -> bytes:
    """With the right checksum of the header, and of frames as far as they go."""
    if len(data) < 16:
        return data
    size = min(int.from_bytes(data[12:16], "little"), len(data) - 16)
    head = b"MROUTBX1" + struct.pack("<II", zlib.crc32(data[16 : 16 + size]), size) + data[16 : 16 + size]
    rest = bytearray(data[16 + size :])
    at = 0
    while at + 44 <= len(rest):
        body = int.from_bytes(rest[at + 4 : at + 8], "little")
        check = zlib.crc32(rest[at + 12 : at + 44], zlib.crc32(rest[at + 4 : at + 9])) >> 8
        rest[at + 9 : at + 12] = check.to_bytes(3, "little")
        rest[at : at + 4] = zlib.crc32(rest[at + 4 : at + 44 + body]).to_bytes(4, "little")
        at += 44 + body
    return head + bytes(rest)


def outbox(data: bytes) -> None:
    """An agent that starts on such a directory sends what is sound, and takes new samples."""
    files = outbox_files()
    name = sorted(files)[data[0] % len(files)] if data else sorted(files)[0]
    for candidate in (data[1:], summed(data[1:])):
        disk = SimDisk(random.Random(1))
        disk.files = {**files, name: candidate}
        box = make_outbox(disk, CLOCK, seed=2)
        for log_name in LOGS:
            while box.take(log_name) is not None:
                pass
        box.append(2, "bulk", 7, b"new")
        accept(box)


def outbox_files() -> dict[str, bytes]:
    """A directory that was used."""
    if not _USED:
        disk = SimDisk(random.Random(1))
        box = make_outbox(disk, CLOCK)
        for number in range(5):
            box.append(2, "bulk", number, b"sample")
            box.append(1, "event", number, b"event")
        box.append(0, "metric", 7, (1, 0.5))
        accept(box)
        _USED.update(disk.files)
    return dict(_USED)


_USED: dict[str, bytes] = {}


def small_files(data: bytes) -> None:
    """The agent's other files: what cannot be read is as if it were not there."""
    disk = SimDisk(random.Random(1))
    body = data.partition(b" ")[2]
    for candidate in (data, b"%08x %s" % (zlib.crc32(body), body)):
        disk.files = {"state.json": candidate, "uplink.json": candidate, "commands.log": candidate}
        assert stored_limit(disk) >= 0
        OutboxState.load(disk)
        CommandLog(disk).first_time(b"id")


def shelf(data: bytes) -> None:
    """The facts beside a recording that waits; whatever they say, it can be offered."""
    name = "01ARZ3NDEKTSV4RRFFQ69G5FAV"

    def run(path: Path) -> None:
        for saved in RecordingStore(path.parent):
            assert saved.size_bytes >= 0
            assert len(bytes.fromhex(saved.sha256)) in (0, 32)

    on_disk(data, run, name=f"{name}.json")


SAVED = {
    "recording_id": "01ARZ3NDEKTSV4RRFFQ69G5FAV",
    "made_ns": 1,
    "size_bytes": 0,
    "sha256": "",
    "from_ns": 1,
    "to_ns": 2,
    "messages": 0,
    "failed": "cut",
}
assert SavedRecording(**SAVED).failed == "cut"  # type: ignore[arg-type]

KEY = SealKey(key_id=b"k" * 8, secret=b"s" * 32, created_ns=1)
ORIGIN = Origin(robot="r", topic="/a", type_name="std_msgs/msg/String", type_hash="h")
SEALED = Sealer(Keyring((KEY,)), CLOCK, entropy=bytes).seal(b"secret", ORIGIN, stream=1, epoch=2, seq=3)
KEYRING = json.dumps(
    {
        "version": 1,
        "keys": [{"id": "6b" * 8, "secret": "c3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3M=", "created_ns": 1}],
    }
).encode()


def opened(data: bytes) -> None:
    """A sealed payload: nothing but what was sealed opens."""
    assert Opener(Keyring((KEY,))).open(data, ORIGIN).payload == b"secret"


def old_log(data: bytes) -> None:
    """A CARMEN log: bad lines are counted."""
    for _ in read_log(io.BytesIO(data), LogCount()):
        pass


FLASER = b"FLASER 2 1.0 2.0 0.1 0.2 0.3 0.4 0.5 0.6 100.5 host 0.5\nODOM 1 2 3 0 0 0 5.5 host 0.1\nPARAM a 5\n"
FILE_SEEDS: Mapping[str, bytes] = {
    f"{c} {i}": mcap_file(c, index=i) for c in ("zstd", "lz4", "none") for i in (True, False)
}

TARGETS = (
    Target(
        name="recording",
        run=bag,
        errors=(RecordingError,),
        seeds=tuple(FILE_SEEDS.values()),
        base_bytes=LIMITS.recorded_chunk_bytes + 8 * MIB,
        cost=40,
    ),
    Target(
        name="black box file",
        run=black_box,
        errors=(RecordingError,),
        seeds=(FILE_SEEDS["zstd True"], FILE_SEEDS["zstd False"]),
        base_bytes=LIMITS.recorded_chunk_bytes + 8 * MIB,
        cost=10,
    ),
    Target(name="segment chunk", run=chunk, errors=(MalformedChunkError,), seeds=(chunk_record(),)),
    Target(name="segment run", run=segment_run, errors=(CorruptObjectError,), seeds=(chunk_record(),)),
    Target(name="series chunk", run=series, errors=(ValueError,), seeds=series_seeds()),
    Target(name="outbox segment", run=log, errors=(), seeds=(log_bytes(),)),
    Target(
        name="outbox directory",
        run=outbox,
        errors=(DiskError,),
        seeds=tuple(bytes([n]) + data for n, (_, data) in enumerate(sorted(outbox_files().items()))),
        base_bytes=16 * MIB,
        cost=30,
    ),
    Target(
        name="agent's small files",
        run=small_files,
        errors=(),
        seeds=(outbox_files()["state.json"], b'x {"bytes_per_s": 5000}', b"00000000 6964\n"),
    ),
    Target(name="waiting recording", run=shelf, errors=(), seeds=(json.dumps(SAVED).encode(),), cost=8),
    Target(name="sealed payload", run=opened, errors=(SealError,), seeds=(SEALED,)),
    Target(
        name="keyring",
        run=lambda data: on_disk(data, Keyring.load, name="seal.keys"),
        errors=(KeyringError,),
        seeds=(KEYRING,),
        cost=4,
    ),
    Target(name="carmen log", run=old_log, errors=(), seeds=(FLASER,)),
    Target(
        name="qos of a recording",
        run=lambda data: read_qos(data.decode("utf-8", "replace")),
        errors=(),
        seeds=(offered_qos([qos_rosout]).encode(),),
        per_byte=3000,
        cost=5,
    ),
)
