"""The slots: what a start finds after every system call that fails, or at which the machine stops."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Iterator
from pathlib import Path
from tempfile import mkdtemp

import pytest

from edge_agent.update import slots as slots_module
from edge_agent.update.errors import SlotError
from edge_agent.update.slots import BASE, Slots, python_of
from tests.support.robots.counting_calls import FAULTS, CountingCalls, PowerCutError, points

MOST = 2
MEMORY = Path("/dev/shm")  # a file system on which a sync costs nothing, where there is one


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    """A directory on the fastest file system there is."""
    path = Path(mkdtemp(dir=MEMORY)) if MEMORY.is_dir() else tmp_path
    yield path
    shutil.rmtree(path)


def fill(slots: Slots, version: str) -> Path:
    """That version, installed beside what runs."""
    folder = slots.empty_one()
    python_of(folder).parent.mkdir(parents=True)
    python_of(folder).write_text(version)
    slots.seal(folder, {"version": version})
    return folder


def update(slots: Slots, version: str) -> None:
    """Installed, switched to, and started."""
    slots.switch(fill(slots, version), version)
    slots.boot(most=MOST)


def life(slots: Slots) -> None:
    """Two good updates, one that ends at every start, and another good one."""
    for version in ("2.1.0", "2.2.0"):
        update(slots, version)
        slots.mark_good()
    update(slots, "2.3.0")
    while slots.boot(most=MOST).version == "2.3.0":
        pass
    update(slots, "2.4.0")
    slots.uncount_boot()
    slots.boot(most=MOST)
    slots.mark_good()


def test_a_life(tmp_path: Path) -> None:
    slots, calls = Slots(tmp_path), CountingCalls()
    life(Slots(tmp_path, calls=calls))
    current = slots.read()
    assert (current.slot, current.version, current.previous_version, current.state) == ("a", "2.4.0", "2.2.0", "good")
    assert 50 < calls.count < 500


@pytest.mark.parametrize("fault", [fault for fault in FAULTS if fault != "ENOSPC"])  # to the slots that is EIO
def test_a_start_finds_a_whole_version_whatever_call_fails(
    folder: Path, fault: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(slots_module, "sync_all", lambda folder: None)  # it syncs all disks of this machine
    whole, found = CountingCalls(), set()
    life(Slots(folder / "whole", calls=whole))
    assert set(whole.names) >= {"open", "write", "fsync", "replace", "unlink", "ftruncate"}
    for fail_at in points(whole, fault):
        state, calls = folder / str(fail_at), CountingCalls(fail_at=fail_at, fault=fault)
        with contextlib.suppress(PowerCutError, SlotError):
            life(Slots(state, calls=calls))
        assert calls.fired
        slots = Slots(state)
        for _ in range(MOST + 2):  # as often as it is started
            current = slots.boot(most=MOST)
            assert slots.complete(current.slot, current.version), (fail_at, calls.name)
            assert current.slot == BASE or python_of(slots.path(current.slot)).read_text() == current.version
            found.add(current.version)
        slots.mark_good()
        update(slots, "9.0.0")
        slots.mark_good()
        assert slots.boot(most=MOST).version == "9.0.0"
        shutil.rmtree(state)
    assert found >= {"", "2.1.0", "2.2.0", "2.4.0"}


def test_a_slot_that_is_half_deleted_is_not_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    slots = Slots(tmp_path)
    for version in ("2.1.0", "2.2.0"):
        update(slots, version)
        slots.mark_good()

    def stop(folder: Path) -> None:
        raise PowerCutError(str(folder))

    monkeypatch.setattr(slots_module.shutil, "rmtree", stop)
    with pytest.raises(PowerCutError):
        slots.empty_one()
    assert not slots.complete("a", "2.1.0")
    assert slots.boot(most=MOST).version == "2.2.0"


def test_a_version_is_counted_before_it_starts_and_taken_back(tmp_path: Path) -> None:
    slots = Slots(tmp_path)
    update(slots, "2.1.0")
    slots.mark_good()
    slots.switch(fill(slots, "2.2.0"), "2.2.0")
    assert [slots.boot(most=2).version for _ in range(3)] == ["2.2.0", "2.2.0", "2.1.0"]
    current = slots.read()
    assert (current.state, current.failed_version, current.boots) == ("good", "2.2.0", 0)
    assert "2 times" in current.failed_reason


def test_a_start_that_cannot_be_counted_is_not_made(tmp_path: Path) -> None:
    slots = Slots(tmp_path)
    update(slots, "2.1.0")
    slots.mark_good()
    slots.switch(fill(slots, "2.2.0"), "2.2.0")

    class ReadOnly(CountingCalls):
        def _watched(self, name: str, real: object) -> object:
            def refuse(*_: object) -> None:
                raise OSError(30, "read-only")

            return refuse

    for _ in range(3):
        assert Slots(tmp_path, calls=ReadOnly()).boot(most=2).version == "2.1.0"


def test_only_one_version_is_on_trial(tmp_path: Path) -> None:
    slots = Slots(tmp_path)
    update(slots, "2.1.0")
    with pytest.raises(SlotError, match=r"2\.1\.0 is being tried"):
        slots.empty_one()
    assert slots.complete("a", "2.1.0")


def test_a_switch_to_what_is_not_whole_is_refused(tmp_path: Path) -> None:
    slots = Slots(tmp_path)
    folder = slots.empty_one()
    with pytest.raises(SlotError):
        slots.switch(folder, "2.1.0")
    fill(slots, "2.1.0")
    with pytest.raises(SlotError):
        slots.switch(folder, "2.2.0")
    assert slots.read().slot == BASE


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        '{"format": 2}',
        '{"format": 1, "slot": "../x"}',
        "\0" * 4096,
        "[" * 100_000,
        '{"format": 1, "slot": 3}',
    ],
)
def test_what_cannot_be_read_is_the_base_install(tmp_path: Path, text: str) -> None:
    slots = Slots(tmp_path)
    update(slots, "2.1.0")
    slots.mark_good()
    (slots.folder / "current").write_text(text)
    assert slots.boot(most=2).slot == BASE
    update(slots, "2.2.0")


def test_a_slot_whose_files_are_gone_is_left(tmp_path: Path) -> None:
    slots = Slots(tmp_path)
    update(slots, "2.1.0")
    slots.mark_good()
    update(slots, "2.2.0")
    slots.mark_good()
    shutil.rmtree(slots.path("b") / "venv")
    assert slots.boot(most=2).version == "2.1.0"
    shutil.rmtree(slots.path("a"))
    assert slots.boot(most=2).slot == BASE
