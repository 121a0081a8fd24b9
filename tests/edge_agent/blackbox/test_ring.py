"""The ring: bounded in bytes and recorded time, whole after kill -9, out of everybody's way on a full disk."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO, cast

import pytest

from edge_agent.blackbox.mcap_reader import records
from edge_agent.blackbox.ring import RETRY_S, free_floor
from metaros.record.bag_index import read_index
from tests.edge_agent.blackbox.rig import SECOND, RingRig

MIB = 1 << 20
MakeRig = Callable[..., RingRig]


def stored(rig: RingRig) -> list[int]:
    """Sequence numbers in the files, in order."""
    return [record.sequence for path in rig.files() for record in records(read_index(path))]


def test_everything_is_there_in_order_with_its_stamps(make_rig: MakeRig, tmp_path: Path) -> None:
    rig = make_rig(tmp_path)
    rig.run(25)
    files = rig.ring.hold()
    assert len(files) == 3
    found = [record for piece in files for record in records(read_index(piece.path))]
    assert [(r.channel.topic, r.sequence, r.log_ns, r.publish_ns, r.payload) for r in found] == rig.written
    assert rig.ring.span_ns == (rig.written[0][2], rig.written[-1][2])
    assert rig.ring.lost == 0


def test_the_oldest_files_go_when_there_are_too_many_bytes(make_rig: MakeRig, tmp_path: Path) -> None:
    rig = make_rig(tmp_path, limit_bytes=1 * MIB)
    for _ in range(300):
        rig.put("/blob", os.urandom(16 * 1024))
        rig.clock.advance(0.1)
    rig.ring.tick()
    assert rig.ring.size_bytes <= 1 * MIB
    assert sum(path.stat().st_size for path in rig.files()) <= 1 * MIB
    found = stored(rig)
    assert found == list(range(found[0], 301))
    assert len(found) > 40, "most of the quota is used"


def test_the_window_is_recorded_time(make_rig: MakeRig, tmp_path: Path) -> None:
    rig = make_rig(tmp_path, window_s=60.0)
    rig.run(200)
    found = stored(rig)
    assert found[-1] == 2000
    assert 600 <= len(found) <= 600 + 210, "a file more than the window at most"


def test_a_jump_of_the_clock_and_an_hour_without_an_agent_delete_nothing(make_rig: MakeRig, tmp_path: Path) -> None:
    rig = make_rig(tmp_path, window_s=60.0)
    rig.run(30)
    rig.clock.jump_wall(10 * 365 * 86400)
    rig.run(20)
    rig.ring.close_file()
    rig.clock.advance(3600)
    rig.open()  # another process
    rig.run(5)
    rig.ring.close_file()
    assert stored(rig) == list(range(1, 551))


def test_what_a_killed_agent_left_is_read_up_to_its_last_whole_chunk(make_rig: MakeRig, tmp_path: Path) -> None:
    rig = make_rig(tmp_path / "ring")
    rig.run(15)
    rig.put("/odom", b"not yet in a chunk")
    shutil.copytree(tmp_path / "ring", tmp_path / "left")
    newest = max((tmp_path / "left").glob("*.mcap"))
    with newest.open("ab") as file:
        file.write(b"\x06half a chunk")
    left = make_rig(tmp_path / "left", clock=rig.clock)
    assert stored(left) == list(range(1, 151))
    assert [piece.number for piece in left.ring.hold()] == [1, 2]
    left.put("/odom", b"more")
    left.ring.close_file()
    assert len(list(left.files())) == 3, "no file is written over"


def test_a_file_of_rubbish_is_deleted(make_rig: MakeRig, tmp_path: Path) -> None:
    (tmp_path / "000000000007.mcap").write_bytes(b"rubbish")
    (tmp_path / "000000000008.mcap").write_bytes(b"")
    (tmp_path / "x.partial").write_bytes(b"draft")
    rig = make_rig(tmp_path)
    assert list(tmp_path.iterdir()) == []
    assert rig.ring.span_ns == (0, 0)


def test_files_that_are_held_stay_until_they_are_released(make_rig: MakeRig, tmp_path: Path) -> None:
    rig = make_rig(tmp_path, limit_bytes=1 * MIB)
    rig.run(20)
    held = rig.ring.hold()
    for _ in range(200):
        rig.put("/blob", os.urandom(16 * 1024))
    rig.ring.tick()
    assert all(piece.path.exists() for piece in held)
    assert rig.ring.size_bytes <= 1 * MIB
    rig.ring.release()
    assert not any(piece.path.exists() for piece in held)


class FullFile:
    """A file on a disk that is full from a place on."""

    def __init__(self, path: Path, room: list[int]) -> None:
        self._file, self._room = path.open("xb", buffering=0), room

    def write(self, data: bytes) -> int:
        if self._room[0] < len(data):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        self._room[0] -= len(data)
        return self._file.write(data)

    def __enter__(self) -> FullFile:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def __getattr__(self, name: str) -> object:
        return getattr(self._file, name)


def test_a_full_disk_costs_a_chunk_and_is_tried_again(
    make_rig: MakeRig, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    room = [40_000]
    rig = make_rig(tmp_path, open_file=lambda path: cast(BinaryIO, FullFile(path, room)))
    for _ in range(100):
        if rig.ring.trouble:
            break
        rig.put("/blob", os.urandom(1000))
        rig.clock.advance(0.1)
        rig.ring.tick()
    last = rig.sequences["/blob"]
    rig.put("/blob", b"while it is full")
    assert (rig.ring.lost, "black box stops" in caplog.text) == (2, True)
    room[0] = 10_000_000
    rig.clock.advance(RETRY_S)
    rig.put("/blob", b"again")
    rig.ring.tick()
    assert rig.ring.trouble == ""
    rig.ring.close_file()
    assert stored(rig)[-1] == last + 2
    publisher = rig.sources["/blob"].publisher
    assert publisher.reasons(last, last + 1) == {"disk": [[last, last + 1]]}


def test_on_a_nearly_full_disk_it_gives_its_files_back_and_stops(make_rig: MakeRig, tmp_path: Path) -> None:
    rig = make_rig(tmp_path)
    rig.run(35)
    assert len(list(rig.files())) >= 3
    rig.free_bytes = free_floor(1 << 40) - 1
    rig.run(3)
    assert list(rig.files()) == []
    assert "bytes are free" in rig.ring.trouble
    lost = rig.ring.lost
    assert lost > 0
    rig.free_bytes = 1 << 40
    rig.clock.advance(RETRY_S)
    rig.run(2)
    assert rig.ring.trouble == ""
    rig.ring.close_file()
    assert stored(rig)[-20:] == list(range(rig.sequences["/odom"] - 19, rig.sequences["/odom"] + 1))


def test_the_span_is_by_log_time(make_rig: MakeRig, tmp_path: Path) -> None:
    rig = make_rig(tmp_path)
    begin_ns = rig.clock.wall_ns()
    rig.run(12)
    first_ns, last_ns = rig.ring.span_ns
    assert first_ns == begin_ns
    assert last_ns == begin_ns + 119 * SECOND // 10
