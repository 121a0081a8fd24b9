"""Bytes of an outbox directory cut off or turned over: what is read is right, the rest declared, or a new epoch."""

from __future__ import annotations

import random  # noqa: TID251 - seeded
from collections.abc import Mapping

import pytest

from edge_agent.outbox import LOGS, run_steps, steps
from metaros.clock import ManualClock
from tests.support.robots.outbox_drain import deliver
from tests.support.simulation.sim_agent import CLASSES, LIMITS, Ledger, WatchedOutbox
from tests.support.simulation.sim_disk import SimDisk
from tests.support.simulation.sim_gateway import Key, SimStore

FRAMES = 2  # at a segment's end, of which every byte is tried
RANDOM_FLIPS = 100


class Directory:
    """The same directory again and again, and what it is known to hold."""

    def __init__(self, files: Mapping[str, bytes], ledger: Ledger) -> None:
        self.disk = SimDisk(random.Random(1))
        self.disk.files = dict(files)
        self.ledger, self.clock, rng = ledger, ManualClock(), random.Random(len(ledger.places))
        self.outbox = WatchedOutbox(
            ledger,
            self.disk,
            self.clock,
            new_epoch=lambda: rng.getrandbits(64),
            writer=f"w{len(ledger.places)}",
            classes=CLASSES,
            reserve_bytes=0,
            limits=LIMITS,
        )
        self.outbox.online = True

    def gather(self, stamps: range, size: int = 30) -> None:
        """A flush of each log for each stamp, so that each sample is a frame of its own."""
        for stamp in stamps:
            self.outbox.append(1, "event", 10 * stamp, bytes(size))
            self.outbox.append(2, "bulk", 10 * stamp + 1, bytes(size))
            self.outbox.append(0, "metric", 10 * stamp + 2, (1, 0.5))
            for name in LOGS:
                run_steps(steps(self.outbox, self.disk, name))


@pytest.fixture(scope="module")
def original() -> tuple[dict[str, bytes], Ledger]:
    """A directory of some segments a log."""
    first = Directory({}, Ledger())
    first.gather(range(1, 20))
    first.gather(range(20, 24), size=2000)
    first.gather(range(24, 30))
    return first.disk.files, first.ledger


def after_damage(files: Mapping[str, bytes], ledger: Ledger) -> tuple[SimStore, Directory]:
    """A process starts on the damaged directory, accepts more, and everything is delivered."""
    directory, store = Directory(files, ledger.copy()), SimStore()
    directory.gather(range(100, 102))
    for _ in range(2):
        deliver(directory.outbox, store)
    assert not any(directory.outbox.depth(name).samples for name in CLASSES)
    return store, directory


def undeclared(store: SimStore, ledger: Ledger, known: Ledger) -> dict[Key, list[int]]:
    """What was accepted before the damage, and is neither stored nor declared; wrong contents fail at once."""
    lost: dict[Key, list[int]] = {}
    for stamp, place in known.places.items():
        keys = [(place[1], epoch) for epoch, _ in ledger.epochs[place[0]]]
        rows = [row for key in keys if (row := store.rows.get(key, {}).get(place[2])) is not None]
        if rows:
            assert rows == [stamp], f"{place} holds {rows}, accepted was {stamp}"
        elif not any(place[2] in store.gaps.get(key, ()) for key in keys):
            lost.setdefault(keys[-1], []).append(place[2])
    return lost


def last_frames(files: Mapping[str, bytes], log: str) -> tuple[str, int]:
    """A log's last segment, and where its last frames begin."""
    from edge_agent.outbox.reader import load_header
    from edge_agent.outbox.segment import scan

    disk = SimDisk(random.Random(1))
    disk.files = dict(files)
    name = disk.names(log)[-1]
    found = scan(files[name], load_header(disk, name)[1])
    return name, found.ends[-FRAMES - 1]


@pytest.mark.parametrize("log", ["event", "bulk", "metric"])
def test_every_prefix_of_the_last_frames(original: tuple[dict[str, bytes], Ledger], log: str) -> None:
    """A write that was cut short: all whole frames are there, in order, and nothing else."""
    files, known = original
    name, start = last_frames(files, log)
    for size in range(start, len(files[name]) + 1):
        store, directory = after_damage({**files, name: files[name][:size]}, known)
        place = directory.ledger.epochs[1]
        assert len(place) == 1, "a cut frame is no reason for another epoch"
        stream = {"event": 1, "bulk": 2, "metric": 0}[log]
        rows = store.rows[stream, place[0][0]]
        old = [stamp for seq, stamp in sorted(rows.items()) if stamp < 1000]
        expected = [stamp for stamp, (_, of, _) in known.places.items() if of == stream][: len(old)]
        assert old == expected
        assert len(old) >= 29 - FRAMES


@pytest.mark.parametrize("log", ["event", "bulk", "metric"])
def test_every_bit_of_the_last_frames(original: tuple[dict[str, bytes], Ledger], log: str) -> None:
    """Damage at the end of a log: the numbers behind it are never given again under that epoch."""
    files, known = original
    name, start = last_frames(files, log)
    for at in range(start, len(files[name])):
        bit = 1 << (at % 8)
        data = bytearray(files[name])
        data[at] ^= bit
        store, directory = after_damage({**files, name: bytes(data)}, known)
        lost = undeclared(store, directory.ledger, known)
        assert not lost or directory.outbox.state.era > 1, f"{name} byte {at}: {lost} lost, and the epoch goes on"


def test_random_bits_of_all_files(original: tuple[dict[str, bytes], Ledger]) -> None:
    """Wherever it is: what is read is right, the rest a gap, or the end of an epoch."""
    files, known = original
    rng = random.Random(5)
    for case in range(RANDOM_FLIPS):
        name = rng.choice(sorted(name for name in files if files[name]))
        data = bytearray(files[name])
        for _ in range(rng.choice((1, 1, 3))):
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        store, directory = after_damage({**files, name: bytes(data)}, known)
        lost = undeclared(store, directory.ledger, known)
        assert not lost or directory.outbox.state.era > 1, f"case {case}, {name}: {lost}"


def test_a_lost_file_in_the_middle_is_a_gap(original: tuple[dict[str, bytes], Ledger]) -> None:
    files, known = original
    names = sorted(name for name in files if name.startswith("bulk/"))
    assert len(names) >= 3
    for name in names[:-1]:
        rest = {other: data for other, data in files.items() if other != name}
        store, directory = after_damage(rest, known)
        assert not undeclared(store, directory.ledger, known)
        assert len(directory.ledger.epochs[1]) == 1
