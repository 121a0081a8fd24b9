"""Results that are kept: what is read from the disk, and what a damaged file means."""

from __future__ import annotations

import random  # noqa: TID251 - seeded
import zlib

import pytest

from edge_agent.commands.stored_results import StoredResults, interrupted
from metaros._proto import link_pb2
from tests.support.simulation.sim_disk import SimDisk

ID = bytes(range(16))
DONE = link_pb2.CommandResult(command_id=ID, ok=True, payload=b"moved", kept=True)


def file(result: link_pb2.CommandResult) -> bytes:
    body = result.SerializeToString()
    return zlib.crc32(body).to_bytes(4, "big") + body


def flipped(data: bytes) -> bytes:
    return data[:-1] + bytes([data[-1] ^ 1])


NO_RESULT = b"\xff\xff\xff"


@pytest.mark.parametrize(
    ("data", "result"),
    [
        (file(DONE), DONE),
        (b"", interrupted(ID)),
        (file(DONE)[:4], interrupted(ID)),
        (zlib.crc32(b"").to_bytes(4, "big"), interrupted(ID)),
        (flipped(file(DONE)), interrupted(ID)),
        (zlib.crc32(NO_RESULT).to_bytes(4, "big") + NO_RESULT, interrupted(ID)),
        (file(link_pb2.CommandResult(command_id=ID[::-1], ok=True)), interrupted(ID)),
    ],
    ids=["whole", "begun", "cut", "empty", "damaged", "nonsense", "another's"],
)
def test_what_is_not_whole_counts_as_interrupted(data: bytes, result: link_pb2.CommandResult) -> None:
    disk = SimDisk(random.Random(1))
    disk.files = {f"results/{ID.hex()}": data, "results/notes.txt": b"of somebody else"}
    assert list(StoredResults(disk)) == [result]
