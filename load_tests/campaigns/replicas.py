"""Three replicas of the gateway on one PostgreSQL, one of them killed again and again under load.

    python -m load_tests.campaigns replicas [--kills 30] [--robots 6] [--seed N]

Robots feed samples without a pause, each to one replica; a page watches all of them. Again and again SIGKILL ends the
replica that a die names, and it is started again. At the end the store has each accepted sample once, each schedule
that was due meanwhile has fired once and opened one alert, and no link took longer than 5 s to come back. Told besides:
how long the page saw nothing of some robot.
"""

from __future__ import annotations

import argparse
import asyncio
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from random import Random

from metaros.clock import system_rng
from tests.support.gateways.replica_schedules import alerts, fired, schedule, wait_for_all
from tests.support.gateways.replicas import Fleet, Replicas, fleet
from tests.support.processes.stack import Stack
from tests.support.robots.uplinks import wait
from tests.support.servers.postgres import PostgresServer

__all__ = ["Figures", "main", "run"]

BACK_S = 5.0  # in which a link has to be back
EVERY_S = 10.0  # between two schedules


@dataclass
class Figures:
    """What was seen."""

    kills: int = 0
    samples: int = 0
    lost: int = 0
    twice: int = 0
    schedules: int = 0
    misfired: int = 0  # schedules that did not fire once
    repeated: int = 0  # alerts that were opened twice
    links_s: list[float] = field(default_factory=list)  # from a kill to the next session of each robot that was there
    views_s: list[float] = field(default_factory=list)  # from a kill until the page saw all robots again

    @property
    def good(self) -> bool:
        """Whether the promise was kept."""
        kept = not (self.lost or self.twice or self.misfired or self.repeated)
        return kept and max(self.links_s, default=0.0) <= BACK_S

    def __str__(self) -> str:
        return (
            f"{self.kills} kills, {self.samples} samples: {self.lost} lost, {self.twice} twice; "
            f"{self.schedules} schedules: {self.misfired} fired not once, {self.repeated} alerts twice; "
            f"links back after {_spread(self.links_s)}; all robots in view again after {_spread(self.views_s)}"
        )


def _spread(seconds: Sequence[float]) -> str:
    ordered = sorted(seconds)
    if not ordered:
        return "–"
    return f"{ordered[len(ordered) // 2]:.2f} s (median), {ordered[-1]:.2f} s (at most, of {len(ordered)})"


async def _view(run: Fleet, figures: Figures) -> None:
    """Wait until the page sees every robot at the replica where it watches."""
    began = time.monotonic()
    await wait(lambda: all(run.watcher.seen[run.watcher.at.name, robot.name] for robot in run.robots), timeout_s=120)
    figures.views_s.append(time.monotonic() - began)


async def _look_at_schedules(replicas: Replicas, names: Sequence[str], figures: Figures) -> None:
    """How often each fired, and whether an alert is there twice."""
    at = replicas.all[0]
    await wait_for_all(at, names, timeout_s=60 + EVERY_S * len(names))
    opened = await alerts(at)
    figures.schedules = len(names)
    figures.misfired = sum(count != 1 for count in (await fired(at)).values())
    figures.repeated = len(opened) - len(set(opened))


async def run(folder: Path, url: str, *, kills: int, robots: int, seed: int) -> Figures:
    """The whole campaign."""
    rng, figures = Random(seed), Figures()
    with Stack(folder) as stack:
        replicas = Replicas(stack, url)
        async with fleet(replicas, robots=robots) as running:
            await _view(running, Figures())
            names = await schedule(replicas.all[0], times=kills, every_s=EVERY_S)
            for number in range(kills):
                killed = rng.choice(replicas.all)
                had = await running.kill(killed)
                running.watcher.seen.clear()
                await asyncio.gather(running.back(had), _view(running, figures))
                await replicas.begin(killed)
                await replicas.met(killed)
                figures.kills = number + 1
                back = max((robot.back_s[-1] for robot in running.robots if robot.name in had), default=0.0)
                what = f"{killed.name} had {len(had)} robots, back in {back:.2f} s"
                print(f"  {figures.kills} of {kills}: {what}", flush=True)
            await _look_at_schedules(replicas, names, figures)
            await running.settle()
        for robot in running.robots:
            found = await replicas.stored(robot.name)
            figures.samples += len(robot.sent)
            figures.lost += len(set(robot.sent) - set(found))
            figures.twice += len(found) - len(set(found))
            figures.links_s += robot.back_s
    return figures


def main(argv: Sequence[str]) -> int:
    """Exit code 1 when something was lost, or stored twice."""
    parser = argparse.ArgumentParser(prog="campaign replicas")
    parser.add_argument("--kills", type=int, default=30)
    parser.add_argument("--robots", type=int, default=6)
    parser.add_argument("--seed", type=int, default=system_rng().randrange(1 << 32))
    options = parser.parse_args(argv)
    print(f"replicas: {options.kills} kills, {options.robots} robots, seed {options.seed}", flush=True)
    server = PostgresServer(durable=True)
    try:
        server.start()
        with tempfile.TemporaryDirectory(prefix="campaign-replicas-") as folder:
            chosen = {"kills": options.kills, "robots": options.robots, "seed": options.seed}
            figures = asyncio.run(run(Path(folder), server.schema(), **chosen))
    finally:
        server.close()
    print(f"{'good' if figures.good else 'BROKEN'}  {figures}", flush=True)
    return int(not figures.good)
