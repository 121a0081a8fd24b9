"""A ring in memory: private to its user, on disk once something happened, found again by who comes next."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import pytest

from edge_agent.blackbox import box as box_module
from edge_agent.blackbox.box import BlackBox
from edge_agent.blackbox.memory import KEPT_IN_MEMORY, memory_folder, move_to_disk
from edge_agent.blackbox.ring import Ring
from edge_agent.config.black_box import BlackBoxSettings
from edge_agent.errors import DiskError
from edge_agent.forwarding.scope import ROSOUT
from metaros.clock import ManualClock, SystemClock
from tests.edge_agent.blackbox.rig import RingRig, arrival, channel_of
from tests.support.waiting import wait_until

TIB = 1 << 40
INFO, FATAL = 20, 50


def ring_in_memory(tmp_path: Path, clock: ManualClock | SystemClock) -> Ring:
    (tmp_path / "disk").mkdir(exist_ok=True)
    return Ring(
        tmp_path / "memory",
        clock,
        window_s=60.0,
        limit_bytes=8 << 20,
        free=lambda: (TIB, TIB),
        disk=tmp_path / "disk",
    )


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.glob("[0-9]*.mcap"))


def test_it_touches_the_disk_when_something_happened_and_both_are_one_ring(tmp_path: Path) -> None:
    rig = RingRig(tmp_path / "unused")
    rig.ring = ring_in_memory(tmp_path, rig.clock)
    memory, disk = tmp_path / "memory", tmp_path / "disk"
    rig.run(25)
    assert list(disk.iterdir()) == []
    rig.ring.keep()
    assert (names(memory), len(names(disk))) == ([], 3)
    rig.run(15)
    rig.ring.close_file()
    assert len(names(memory)) == 2
    again = ring_in_memory(tmp_path, rig.clock)
    assert [piece.number for piece in again.hold()] == [1, 2, 3, 4, 5]
    again.keep()
    assert len(names(memory)) == 2, "what is read stays where it is"
    again.release()
    rig.ring = again
    rig.run(70)
    assert names(disk) == [], "what was kept goes when as much was recorded after it"
    rig.ring.close_file()


@pytest.mark.parametrize(("level", "kept"), [(INFO, False), (FATAL, True)])
def test_a_fatal_log_line_puts_what_led_there_on_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, level: int, kept: bool
) -> None:
    for name, value in {"GATHER_S": 0.01, "TICK_S": 0.02, "AFTER_S": 0.0}.items():
        monkeypatch.setattr(box_module, name, value)
    box = BlackBox(BlackBoxSettings(), lambda: ring_in_memory(tmp_path, SystemClock()), SystemClock())
    box.start()
    line = bytes(12) + bytes([level]) + bytes(40)
    box.take([arrival(channel_of("/odom"), 1, b"x"), arrival(replace(channel_of("/odom"), topic=ROSOUT), 1, line)])
    wait_until(lambda: box.describe().to_ns > 0)
    if kept:
        wait_until(lambda: names(tmp_path / "disk"))
    assert bool(names(tmp_path / "disk")) == kept
    box.close()
    assert ((tmp_path / "memory").exists(), bool(names(tmp_path / "disk"))) == (False, True), "an end keeps it, too"


def test_the_folder_is_this_users_alone_and_goes_with_its_agents_state(tmp_path: Path) -> None:
    base, first, second = (tmp_path / name for name in ("shm", "first", "second"))
    base.mkdir()
    folder = memory_folder(first, base=base)
    assert folder is not None
    assert (folder.stat().st_mode & 0o777, (first / KEPT_IN_MEMORY).resolve()) == (0o700, folder)
    assert memory_folder(first, base=base) == folder
    (first / KEPT_IN_MEMORY).unlink()
    first.rmdir()
    other = memory_folder(second, base=base)
    assert list(base.iterdir()) == [other]
    assert other is not None
    other.chmod(0o755)
    assert memory_folder(second, base=base) is None, "others can read it"
    assert memory_folder(second, base=tmp_path / "none") is None


def test_what_the_disk_does_not_take_stays_in_memory(tmp_path: Path) -> None:
    path = tmp_path / "1.mcap"
    path.write_bytes(b"x")
    with pytest.raises(DiskError):
        move_to_disk(path, tmp_path / "none")
    assert os.listdir(tmp_path) == ["1.mcap"]
