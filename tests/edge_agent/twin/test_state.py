"""The twin's record on disk: whole at every crash point, and never a reason not to start."""

from __future__ import annotations

import json
import random  # noqa: TID251 - seeded
from pathlib import Path

import pytest

from edge_agent.errors import DiskFullError
from edge_agent.outbox import OsDisk
from edge_agent.twin.record import OWN, Pending, Record, Version
from edge_agent.twin.state import FILE, TwinFile
from tests.support.simulation.sim_disk import Crash, SimDisk

ONE = Version(revision=1, document=b'{"budget":{"bytes_per_s":1000}}')
TWO = Version(revision=2, document='{"parameters":{"/n":{"name":"Zürich"}}}'.encode())
BEFORE = Record(applied=ONE, seen=1)
TRIAL = Record(applied=ONE, pending=Pending(version=TWO, until_s=12.5, boot_id="b"), seen=2)


def test_a_record_comes_back_as_it_was_kept(tmp_path: Path) -> None:
    file = TwinFile(OsDisk(tmp_path))
    assert file.load() == Record()
    for record in (BEFORE, TRIAL, Record(seen=3, undone="reverted", code="not_confirmed", message="…")):
        file.keep(record)
        assert TwinFile(OsDisk(tmp_path)).load() == record
    assert sorted(path.name for path in (tmp_path / "twin").iterdir()) == ["twin.json"]


def test_whatever_moment_the_power_goes_there_is_one_whole_record() -> None:
    seen = set()
    for seed in range(40):
        disk = SimDisk(random.Random(seed))
        TwinFile(disk).keep(BEFORE)
        disk.crash_in = 0
        with pytest.raises(Crash):
            TwinFile(disk).keep(TRIAL)
        record = TwinFile(disk).load()
        assert record in (BEFORE, TRIAL)
        seen.add(record.seen)
    assert seen == {1, 2}


def test_a_draft_that_a_crash_left_is_not_read(tmp_path: Path) -> None:
    file = TwinFile(OsDisk(tmp_path))
    file.keep(BEFORE)
    (tmp_path / "twin" / "twin.json.tmp").write_bytes(b'{"format": 1, "appl')
    assert file.load() == BEFORE
    file.keep(TRIAL)
    assert file.load() == TRIAL


@pytest.mark.parametrize(
    "data", [b"", b"{", b"[]", b"null", b'{"format":2}', b'{"format":1,"applied":[]}', b"\xff\xfe"]
)
def test_a_damaged_file_leaves_the_robot_its_own_settings(data: bytes) -> None:
    disk = SimDisk(random.Random(1))
    disk.files[FILE] = data
    assert TwinFile(disk).load() == Record()


def test_a_document_that_an_older_agent_does_not_take_is_not_lived_by() -> None:
    disk = SimDisk(random.Random(1))
    TwinFile(disk).keep(TRIAL)
    table = json.loads(disk.files[FILE])
    table["pending"]["document"] = '{"teleportation":{}}'
    disk.files[FILE] = json.dumps(table).encode()
    record = TwinFile(disk).load()
    assert (record.applied, record.pending, record.undone, record.code) == (ONE, None, "refused", "twin_invalid")
    table["applied"]["document"] = '{"teleportation":{}}'
    disk.files[FILE] = json.dumps(table).encode()
    assert TwinFile(disk).load().applied == OWN


def test_a_full_disk_keeps_what_was(tmp_path: Path) -> None:
    disk = SimDisk(random.Random(1))
    TwinFile(disk).keep(BEFORE)
    disk.size_bytes = disk.used_bytes
    with pytest.raises(DiskFullError):
        TwinFile(disk).keep(TRIAL)
    assert TwinFile(disk).load() == BEFORE
