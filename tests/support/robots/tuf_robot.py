"""A robot that takes updates: its files, its clock, and an old version that runs."""

from __future__ import annotations

import asyncio
import json
import random  # noqa: TID251 - seeded
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from edge_agent.update.errors import UpdateError
from edge_agent.update.fetch import TransferLimits
from edge_agent.update.files import replace_table
from edge_agent.update.restart import LoaderInfo
from edge_agent.update.slots import Current, Slots, python_of
from edge_agent.update.source import Source
from edge_agent.update.updater import AgentUpdates
from metaros.clock import ManualClock
from metaros.fleet.bundle import BundleError
from tests.support.gateways.plain_http import TRUSTS_NOBODY
from tests.support.servers.tuf_repository import Served, TufRepository, serve, utc

__all__ = ["OLD", "Hurry", "TufRobot", "fill_slot", "tuf_robot"]

OLD = "2.0.0"
PATIENT = TransferLimits(head_s=60.0, span_s=60.0, span_bytes=10_000)


class Hurry:
    """Patience that ends once a certain file was asked for: what comes after it is to be slow."""

    span_bytes = PATIENT.span_bytes

    def __init__(self, served: Served, after: str, *, head_s: float, span_s: float) -> None:
        self._served, self._after, self._short = served, after, (head_s, span_s)
        self._now = (PATIENT.head_s, PATIENT.span_s)

    @property
    def head_s(self) -> float:
        """It is read once a file, before it is asked for."""
        asked = self._served.asked
        self._now = self._short if asked and asked[-1][0].endswith(self._after) else (PATIENT.head_s, PATIENT.span_s)
        return self._now[0]

    @property
    def span_s(self) -> float:
        """Of the same file."""
        return self._now[1]


class HalfClock(ManualClock):
    """The calendar is the test's, the count of seconds the machine's: sockets have the machine's, too."""

    def monotonic_s(self) -> float:
        return time.monotonic()


def fill_slot(slots: Slots, slot: str, version: str, *, min_version: str = "") -> Path:
    """A slot with a version of which only its interpreter's name is there."""
    folder = slots.path(slot)
    python_of(folder).parent.mkdir(parents=True)
    python_of(folder).touch()
    slots.seal(folder, {"version": version, "min_version": min_version})
    return folder


class TufRobot:
    """`2.0.0` runs in slot a. `attempt` tries an update as the agent does."""

    def __init__(self, state_dir: Path, served: Served, clock: ManualClock) -> None:
        self.state_dir, self.served, self.clock = state_dir, served, clock
        self.slots = Slots(state_dir)
        self.restarts = 0
        self.patience: TransferLimits | Hurry = PATIENT
        fill_slot(self.slots, "a", OLD)
        replace_table(self.slots.folder / "current", json.loads(json.dumps({"format": 1, **_good()})))
        self.begin()

    def begin(self) -> None:
        """The agent starts."""
        self.source = Source(
            self.state_dir / "update",
            self.served.url,
            lambda: TRUSTS_NOBODY,
            self.clock,
            groups=("east",),
            patience=self.patience,  # type: ignore[arg-type]
        )
        self.source.folder.mkdir(parents=True, exist_ok=True)
        self.updates = AgentUpdates(
            self.slots,
            self.source,
            self.clock,
            random.Random(1),
            loader_info=LoaderInfo(loader=("loader",)),
            running=OLD,
            restart=self._restart,
        )

    def _restart(self) -> None:
        self.restarts += 1

    async def attempt(self, version: str = "2.1.0") -> str:
        """The code of the refusal; "" where the new version is to start now."""
        done = await self.updates.attempt(version)
        return "" if done else self.code

    async def takes(self, version: str = "2.1.0") -> str:
        """The same, but that nothing is installed where nothing is refused, which takes seconds."""
        try:
            await asyncio.to_thread(self._unpack, version)
        except (UpdateError, BundleError) as error:
            return error.code
        return ""

    def _unpack(self, version: str) -> None:
        what = {"kind": "agent", "name": "metaros", "version": version}
        with self.source.bundle(**what) as fetched:
            self.source.unpack(fetched, self.slots.empty_one(), **what)

    @property
    def code(self) -> str:
        """What the gateway is told."""
        return str(self.updates.reported()["update"]["code"])

    def check_old_runs(self) -> None:
        """Nothing has changed for the next start, nothing restarts, and nothing is left over."""
        current = self.slots.boot(most=3)
        assert (current.slot, current.version, current.state) == ("a", OLD, "good")
        assert self.restarts == 0
        assert not (self.source.folder / "bundle.zip").exists()
        report = self.updates.reported()
        assert report["version"] == OLD
        assert report["update"]["state"] in ("refused", "downloading")


def _good() -> dict[str, object]:
    from dataclasses import asdict

    return asdict(Current(slot="a", version=OLD))


@contextmanager
def tuf_robot(folder: Path) -> Iterator[tuple[TufRobot, TufRepository, Served]]:
    """A robot, a repository with 2.0.0 and 2.1.0, and its server."""
    clock = HalfClock()
    repository = TufRepository(utc(clock.wall_ns()))
    repository.add_agent(OLD)
    repository.add_agent("2.1.0")
    repository.publish()
    with serve(repository) as served:
        yield TufRobot(folder / "state", served, clock), repository, served
