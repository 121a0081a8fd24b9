"""A program for a small disk of its own: fills it and frees it under an outbox, and counts what became of the samples.

python -m tests.support.robots.full_disk DIRECTORY CYCLES    prints a JSON object
"""

from __future__ import annotations

import json
import random  # noqa: TID251 - seeded
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from edge_agent.errors import DiskError, DiskFullError
from edge_agent.outbox import LOGS, OsDisk, run_steps, steps
from metaros.clock import ManualClock
from tests.support.robots.outbox_drain import check_ledger, deliver
from tests.support.simulation.sim_agent import CLASSES, LIMITS, Ledger, WatchedOutbox
from tests.support.simulation.sim_gateway import SimStore

KIB = 1024


@contextmanager
def full(folder: Path) -> Iterator[None]:
    """Somebody else writes until nothing more fits."""
    path = folder / "filler"
    with path.open("wb", buffering=0) as file:
        for size in (64 * KIB, KIB, 1):
            with suppress(OSError):
                while file.write(bytes(size)) == size:
                    pass
    try:
        yield
    finally:
        path.unlink()


class Robot:
    """An outbox on the disk and what comes to it."""

    def __init__(self, folder: Path) -> None:
        self.disk, self.clock, self.ledger = OsDisk(folder / "outbox"), ManualClock(), Ledger()
        self.store, self._rng, self._stamp = SimStore(), random.Random(1), 0
        self.events: list[int] = []
        self.outbox = self.start()

    def start(self) -> WatchedOutbox:
        """A process begins."""
        outbox = WatchedOutbox(
            self.ledger,
            self.disk,
            self.clock,
            new_epoch=lambda: self._rng.getrandbits(64),
            writer=f"{self._rng.getrandbits(64):016x}",
            classes=CLASSES,
            reserve_bytes=16 * KIB,
            limits=LIMITS,
        )
        outbox.online = True
        return outbox

    def gather(self) -> int:
        """A sample of each class, flushed; how many samples are accepted since."""
        before = len(self.ledger.places)
        for stream, delivery in ((1, "event"), (2, "bulk"), (0, "metric")):
            self._stamp += 1
            self.outbox.append(stream, delivery, self._stamp, (1, 0.5) if delivery == "metric" else bytes(900))
            if delivery == "event":
                self.events.append(self._stamp)
        for name in LOGS:
            run_steps(steps(self.outbox, self.disk, name))
        self.clock.advance(1.0)
        return len(self.ledger.places) - before


def main(folder: Path, cycles: int) -> dict[str, int]:
    """Fill and free; every third time the process is started again on the full disk."""
    robot = Robot(folder)
    accepted_full = resumed = restarts = 0
    for cycle in range(cycles):
        with suppress(DiskError):
            robot.outbox.restore_reserve()
        robot.gather()
        with full(folder):
            accepted_full += sum(robot.gather() for _ in range(30))
            refused = False
            if cycle % 3 == 2:  # an event is accepted once it is synced: what waited for that is gone with the process
                robot.events = [stamp for stamp in robot.events if stamp in robot.ledger.places]
                restarts += 1
                try:
                    robot.outbox = robot.start()
                    accepted_full += sum(robot.gather() for _ in range(3))
                except DiskFullError:  # it has not even the room to say who it is; the supervisor tries again
                    refused = True
        if refused:
            robot.outbox = robot.start()
        resumed += robot.gather() >= 3  # the first flush after there is space again takes all that came
        deliver(robot.outbox, robot.store)
    deliver(robot.outbox, robot.store)
    check_ledger(robot.ledger, robot.store)
    stored = {stamp for rows in robot.store.rows.values() for stamp in rows.values()}
    return {
        "cycles": cycles,
        "resumed": resumed,
        "restarts": restarts,
        "accepted_on_a_full_disk": accepted_full,
        "events": len(robot.events),
        "events_stored": sum(stamp in stored for stamp in robot.events),
        "declared_lost": sum(map(len, robot.store.gaps.values())),
    }


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]), int(sys.argv[2]))))
