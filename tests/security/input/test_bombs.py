"""Bombs: a few bytes that claim, or would make, far more. Each is refused before memory passes its bound.

What a decoder may take is measured by tracemalloc, which sees Python's and numpy's memory and that of zstd and lz4
results; a decoder that believed a claim of a GiB would be a thousand times over the bound.
"""

from __future__ import annotations

import struct
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import lz4.frame
import numpy as np
import pytest
import zstandard
from google.protobuf.message import DecodeError as ProtobufError
from pydantic import ValidationError

from edge_agent.config.settings import load_settings
from gateway.api.models import common
from gateway.api.ws.requests import read_request
from gateway.errors import GatewayError, InvalidRequestError, ProtocolError
from gateway.fleet.ros.types import TypeRegistry
from gateway.ingest.handshake import check_hello, read_channel
from gateway.ingest.session import Session
from gateway.ingest.streams import StreamTable
from gateway.store.telemetry import chunks
from gateway.store.telemetry.segments import open_chunk
from metaros._proto import link_pb2
from metaros.broker.frames import parse_payload
from metaros.cdr import codec
from metaros.convert.compressed import compressed_to_numpy
from metaros.errors import ConfigError, DecodeError, DefinitionError, FrameError, MetarosError, RecordingError
from metaros.idl import Catalogue, add_schema_text, parse_definition
from metaros.interfaces.sensor_msgs.msg import CompressedImage
from metaros.limits import LIMITS
from metaros.link import Reassembler, decompress, unpack_batch, unpack_metrics
from metaros.mcap import MalformedChunkError, read_chunk
from metaros.record.bag_index import read_index
from metaros.record.qos_yaml import read_qos
from metaros.supervise.launch_table import parse_table

pytestmark = pytest.mark.integration

MIB = 1024 * 1024
BOUND = 2 * LIMITS.sample_bytes  # twice the largest thing that any of these may make
LANES = (link_pb2.LANE_CONTROL, link_pb2.LANE_DATA, link_pb2.LANE_BACKFILL)


def refused(run: Callable[[], Any], *errors: type[Exception], bound: int = BOUND) -> None:
    """It raises one of these, and took no more memory than that on the way."""
    tracemalloc.start()
    try:
        with pytest.raises(errors):
            run()
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak <= bound


def zeros(size: int, *, told: bool = True) -> bytes:
    """So many zeros, compressed; `told`: the frame says how many."""
    if told:
        return zstandard.ZstdCompressor().compress(bytes(size))
    stream = zstandard.ZstdCompressor().compressobj()
    return b"".join([*(stream.compress(bytes(MIB)) for _ in range(size // MIB)), stream.flush()])


def wide_window() -> bytes:
    """A frame that wants a window of 2 GiB for a few bytes."""
    return bytes.fromhex("28b52ffd") + bytes([0x00, (31 - 10) << 3]) + bytes.fromhex("010000")


def claims(size: int) -> bytes:
    """A frame that says it holds so many bytes, and ends after a few."""
    return bytes.fromhex("28b52ffd") + bytes([0xE0]) + struct.pack("<Q", size) + bytes.fromhex("0b0000") + b"\0"


def batch(payload: bytes, lengths: list[int], *, compressed: bool = True) -> link_pb2.Batch:
    """A batch of samples that say they are so long."""
    count = len(lengths)
    return link_pb2.Batch(
        stream_id=1,
        epoch=1,
        first_seq=1,
        count=count,
        stamps=bytes(8 * count),
        lengths=np.asarray(lengths, "<u4").tobytes(),
        payload=payload,
        compression=link_pb2.COMPRESSION_ZSTD if compressed else link_pb2.COMPRESSION_NONE,
    )


# Made by the test: a bomb takes a while, and whoever only looks for tests need not wait.
BATCHES: dict[str, Callable[[], link_pb2.Batch]] = {
    "64 MiB in the place of 1000 bytes": lambda: batch(zeros(64 * MIB), [1000]),
    "the same without a size": lambda: batch(zeros(64 * MIB, told=False), [1000]),
    "a claim of 4 GiB": lambda: batch(claims(1 << 32), [1000]),
    "a claim of 2^63": lambda: batch(claims(1 << 63), [1000]),
    "a window of 2 GiB": lambda: batch(wide_window() * 20, [1000]),
    "lengths of 16 GiB": lambda: batch(zeros(1000), [0xFFFFFFFF] * 4),
    "16 MiB from 600 bytes": lambda: batch(zeros(16 * MIB)[:600], [16 * MIB]),
    "a bomb in a bomb": lambda: batch(zstandard.compress(zeros(64 * MIB)), [64 * MIB]),
    "lengths without payload": lambda: batch(b"", [0xFFFFFFFF] * 4096, compressed=False),
}


@pytest.mark.parametrize("name", BATCHES)
def test_a_batch(name: str) -> None:
    bomb = BATCHES[name]()
    refused(lambda: unpack_batch(decompress(bomb)), FrameError)


def test_pieces_without_end_take_no_more_than_was_announced() -> None:
    def endless() -> None:
        pieces = Reassembler()
        for index in range(1000):
            piece = batch(bytes(MIB), [MIB], compressed=False)
            piece.chunk_index, piece.chunk_count = index, 0xFFFFFFFF
            pieces.feed(piece)

    refused(endless, FrameError, bound=4 * MIB)


def test_samples_that_never_end_are_bounded_together() -> None:
    def many() -> None:
        pieces = Reassembler()
        for stream in range(1, 1000):
            piece = batch(b"x", [LIMITS.sample_bytes], compressed=False)
            piece.stream_id, piece.chunk_count = stream, 2
            pieces.feed(piece)

    refused(many, FrameError, bound=MIB)


def test_metric_rows_by_their_count() -> None:
    rows = link_pb2.MetricBatch(epoch=1, first_seq=1, count=0xFFFFFFFF)
    refused(lambda: unpack_metrics(rows), FrameError, bound=MIB)


def chunk(data: bytes, size: int, compression: bytes = b"zstd") -> bytes:
    """A chunk record of an MCAP file that says it holds so many bytes."""
    body = struct.pack("<QQQII", 0, 1, size, 0, len(compression)) + compression + struct.pack("<Q", len(data)) + data
    return struct.pack("<BQ", 6, len(body)) + body


CHUNKS: dict[str, Callable[[], bytes]] = {
    "a claim of 4 GiB in its data": lambda: chunk(claims(1 << 32), 1000),
    "64 MiB in the place of 1000 bytes": lambda: chunk(zeros(64 * MIB), 1000),
    "the same without a size": lambda: chunk(zeros(64 * MIB, told=False), 1000),
    "a size of 2^63": lambda: chunk(zeros(1000), 1 << 63),
    "a window of 2 GiB": lambda: chunk(wide_window(), 1000),
    "lz4 where it is not known": lambda: chunk(lz4.frame.compress(bytes(64 * MIB)), 64 * MIB, b"lz4"),
}


@pytest.mark.parametrize("name", CHUNKS)
def test_a_chunk_of_a_segment(name: str) -> None:
    bomb = CHUNKS[name]()
    refused(lambda: read_chunk(bomb, most_bytes=MIB), MalformedChunkError, bound=4 * MIB)
    refused(lambda: open_chunk(bomb), GatewayError)


RECORDINGS: dict[str, Callable[[], bytes]] = {
    **{f"chunk: {name}": make for name, make in CHUNKS.items() if not name.startswith("lz4")},
    "lz4: 64 MiB in the place of 1000 bytes": lambda: chunk(lz4.frame.compress(bytes(64 * MIB)), 1000, b"lz4"),
    "lz4: a size of 2^40": lambda: chunk(lz4.frame.compress(bytes(1000)), 1 << 40, b"lz4"),
    "a record of 4 GiB": lambda: struct.pack("<BQ", 3, 1 << 32),
    "a chunk in a chunk": lambda: chunk(chunk(zeros(1000), 1000), len(chunk(zeros(1000), 1000)), b""),
}


@pytest.mark.parametrize("name", RECORDINGS)
def test_a_recording(tmp_path: Path, name: str) -> None:
    path = tmp_path / "bomb.mcap"
    path.write_bytes(b"\x89MCAP0\r\n" + RECORDINGS[name]())
    tracemalloc.start()
    try:
        found = read_index(path)
        peak = tracemalloc.get_traced_memory()[1]
    except RecordingError:
        peak = tracemalloc.get_traced_memory()[1]
    else:
        assert found.damage
        assert not found.chunks
    finally:
        tracemalloc.stop()
    assert peak <= BOUND


MERGES = "a: &a {k: v}\n" + "".join(f"a{n}: &a{n} {{<<: [*{'a' if not n else f'a{n - 1}'}, *a]}}\n" for n in range(200))
LAUGHS = "- &a [x, x]\n" + "".join(f"- &{chr(98 + n)} [*{chr(97 + n)}, *{chr(97 + n)}]\n" for n in range(24))
DURATION = "- {history: 1, depth: 1, reliability: 1, durability: 1, deadline: {sec: aaaaaaaa, nsec: a}}"


@pytest.mark.parametrize("text", [MERGES, LAUGHS, DURATION, "[" * 5000, "x" * 10_000_000], ids=range(5))
def test_the_qos_of_a_recording(text: str) -> None:
    tracemalloc.start()
    try:
        assert read_qos(text) == []
        assert tracemalloc.get_traced_memory()[1] <= 2 * MIB + len(text)
    finally:
        tracemalloc.stop()


def test_a_column_of_a_series() -> None:
    stamps = struct.pack("<BBqQ", 8, 1, 0, 0) + zeros(64 * MIB)
    refused(lambda: chunks.decode([(chunks.ENCODING, 100, stamps, b"\x01" + bytes(8))]), ValueError, bound=MIB)
    values = bytes([2 | 32]) + claims(1 << 32)
    good = struct.pack("<BBqQ", 0, 0, 0, 1)
    refused(lambda: chunks.decode([(chunks.ENCODING, 100, good, values)]), ValueError, bound=MIB)


def png(width: int, height: int, *, rest: bytes = b"") -> bytes:
    """The beginning of a PNG."""
    return b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sIIBBBBBI", 13, b"IHDR", width, height, 8, 6, 0, 0, 0, 0) + rest


def jpeg(width: int, height: int) -> bytes:
    """The beginning of a JPEG."""
    return b"\xff\xd8\xff\xc0" + struct.pack(">HBHHB", 17, 8, height, width, 3) + bytes(9)


PICTURES = {
    "png 65535": png(65535, 65535),
    "png 2^31": png(2**31 - 1, 2**31 - 1),
    "png of one line": png(2**31 - 1, 1),
    "png with a chunk of 4 GiB": png(4, 4, rest=struct.pack(">I4s", 0xFFFFFFFF, b"IDAT") + bytes(100)),
    "jpeg 65500": jpeg(65500, 65500),
    "jpeg, progressive": jpeg(65500, 65500).replace(b"\xff\xc0", b"\xff\xc2"),
    "webp": b"RIFF\xff\xff\xff\xffWEBPVP8L\xff\xff\xff\xff\x2f\xff\xff\xff\xff",
    "gif": b"GIF89a\xff\xff\xff\xff\0\0\0",
    "tiff": b"II*\0\xff\xff\xff\xff",
    "bmp": b"BM" + b"\xff" * 60,
    "exr": b"\x76\x2f\x31\x01" + b"\xff" * 60,
    "jpeg 2000": b"\0\0\0\x0cjP  \r\n\x87\n" + b"\xff" * 60,
}


@pytest.mark.parametrize("name", PICTURES)
def test_a_picture(name: str) -> None:
    refused(lambda: compressed_to_numpy(CompressedImage(data=PICTURES[name])), MetarosError, bound=MIB)


@pytest.mark.parametrize(
    "name",
    [
        "std_msgs/msg/String",
        "tf2_msgs/msg/TFMessage",
        "sensor_msgs/msg/PointCloud2",
        "diagnostic_msgs/msg/DiagnosticArray",
    ],
)
def test_lengths_in_cdr(name: str) -> None:
    for data in (
        b"\0\1\0\0" + b"\xff" * 64,
        b"\0\1\0\0" + b"\xff\xff\xff\x7f" * 16,
        b"\0\0\0\0" + b"\x0f\xff\xff\xff" * 16,
    ):
        refused(lambda data=data: codec(name).decode(data), DecodeError, bound=MIB)  # type: ignore[misc]


SCHEMAS = {
    "a thousand levels": "a/L0 x\n"
    + "".join(f"===\nMSG: a/L{n}\na/L{n + 1} x\n" for n in range(1000))
    + "===\nMSG: a/L1000\nbool x\n",
    "itself": "a/Thing x\n",
    "a ring": "a/A x\n===\nMSG: a/A\na/B x\n===\nMSG: a/B\na/A x\n",
    "two to the thirtieth": "a/L0 x\n"
    + "".join(f"===\nMSG: a/L{n}\na/L{n + 1} x\na/L{n + 1} y\n" for n in range(30))
    + "===\nMSG: a/L30\nbool x\n",
    "20,001 fields": "".join(f"bool x{n}\n" for n in range(20_001)),
    "arrays in arrays": "a/A[16777216] x\n===\nMSG: a/A\na/B[16777216] x\n===\nMSG: a/B\nfloat64[16777216] x\n",
    "16 million messages": "a/A[16777216] x\n===\nMSG: a/A\nbool x\n",
    "16 million texts": "string[16777216] x\n",
    "a size of 5000 digits": f"bool[{'9' * 5000}] x\n",
    "a name that fits in many ways": f"bool {'a' * 40_000}!\n",
    "no more than a separator": "===\n" * 10_000,
}


@pytest.mark.parametrize("name", SCHEMAS)
def test_a_schema(name: str) -> None:
    def learn() -> None:
        catalogue = Catalogue()
        add_schema_text("a/msg/Thing", SCHEMAS[name], catalogue)
        codec("a/msg/Thing", catalogue)

    refused(learn, DefinitionError, bound=64 * MIB)


def test_a_type_whose_least_message_is_large_is_not_sent() -> None:
    text = "float64[8388608] x\n"
    said = link_pb2.Channel(
        channel_id=1, topic="/a", schema_name="a/msg/Big", schema_encoding="ros2msg", schema=text.encode()
    )
    setattr(said, "class", 3)
    known = read_channel("r", said, limits=LIMITS)
    refused(lambda: TypeRegistry().encode("a/msg/Big", {}, known), InvalidRequestError, bound=2 * MIB)


def test_a_definition_over_its_limit() -> None:
    refused(lambda: parse_definition("#" * 1_000_001, "a/msg/A"), DefinitionError, bound=4 * MIB)


def hello(**changes: Any) -> link_pb2.Hello:
    """A Hello that is good but for the changes."""
    good = {"protocol": 1, "robot_id": "r1", "session_id": bytes(16), "session_number": 7, "namespace": "/", "lane": 1}
    return link_pb2.Hello(**{**good, **changes})


HELLOS: dict[str, dict[str, Any]] = {
    "streams": {"streams": [link_pb2.StreamState(stream_id=1)] * 10_000},
    "epochs": {"epochs": range(10_000)},
    "writers": {"writers": ["w"] * 10_000},
    "labels": {"labels": {str(n): "x" for n in range(1000)}},
    "a long label": {"labels": {"a": "x" * 100_000}},
    "a long host name": {"hostname": "x" * 100_000},
}


@pytest.mark.parametrize("name", HELLOS)
def test_a_hello(name: str) -> None:
    refused(lambda: check_hello(hello(**HELLOS[name]), limits=LIMITS), ProtocolError, bound=4 * MIB)


@pytest.mark.parametrize(
    ("count", "schema_bytes"), [(4097, 0), (200, LIMITS.schema_bytes), (1, LIMITS.schema_bytes + 1)]
)
def test_channels_and_their_schemas(count: int, schema_bytes: int) -> None:
    session = Session(hello(), StreamTable(), gateway_id="g", store_id="s")
    for lane in LANES:
        session.open_lane(hello(lane=lane), now_s=1.0, wall_ns=1)
    codes: list[str] = []
    for number in range(1, count + 1):
        said = link_pb2.Channel(channel_id=number, topic="/a", schema_name="a/msg/A", schema=bytes(schema_bytes))
        setattr(said, "class", 3)
        announce = link_pb2.AgentFrame(announce=link_pb2.Announce(channels=[said]))
        codes += [
            event.code for event in session.receive(LANES[0], announce, now_s=2.0, wall_ns=1) if hasattr(event, "code")
        ]
    assert codes == ["protocol"] or codes == [ProtocolError.code]
    assert sum(len(known.schema) for known in session.channels.values()) <= LIMITS.schemas_bytes + LIMITS.schema_bytes


@pytest.mark.parametrize(
    "data",
    [b"\x0b" * 100_000, b"\x1a\xff\xff\xff\xff\x0f" + bytes(100), b"\x1a\x80\x80\x80\x80\x80\x80\x80\x80\x80\x80\x01"],
    ids=["groups in groups", "a length of 4 GiB", "a number without end"],
)
def test_protobuf(data: bytes) -> None:
    refused(lambda: link_pb2.AgentFrame.FromString(data), ProtobufError, bound=MIB)


DEEP = {f"{kind} {depth:,}": kind * depth for kind in ("[", '{"a":') for depth in (100_000, 1_000_000)}


@pytest.mark.parametrize("name", DEEP)
def test_json_that_is_deep(name: str) -> None:
    text = DEEP[name]
    refused(lambda: read_request(text[: LIMITS.json_bytes]), InvalidRequestError, bound=BOUND)
    refused(lambda: parse_payload(text.encode()), FrameError, bound=BOUND)
    refused(lambda: common.PublishRequest.model_validate_json(text), ValidationError, bound=BOUND)
    whole = text + ("]" if text[0] == "[" else "1}") * text.count("a" if text[0] == "{" else "[")
    refused(lambda: parse_payload(whole.encode()), FrameError, bound=BOUND)


@pytest.mark.parametrize(
    "text",
    ["a = " + "[" * 100_000, "a = " + "{b = " * 50_000, "[" + "a." * 3_000 + "a]\n", "a = 1\n" * 200_000],
    ids=["lists", "tables", "dots", "too long"],
)
def test_toml(tmp_path: Path, text: str) -> None:
    path = tmp_path / "agent.toml"
    path.write_text(text)
    refused(lambda: load_settings(path), ConfigError, bound=BOUND)
    refused(lambda: parse_table(text, path), ConfigError, bound=16 * BOUND)
