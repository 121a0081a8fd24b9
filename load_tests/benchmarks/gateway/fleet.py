"""A fleet on one gateway: thousands of robots in this process, over the real link, and a report of what that took.

    python -m load_tests fleet                    100 robots for ten seconds, to see that it runs
    python -m load_tests fleet steady             5,000 idle and 500 active robots: about five minutes
    python -m load_tests fleet storm              1,000 robots, the gateway killed under them: about two minutes
    python -m load_tests fleet viewers            100 viewers on 20 robots, one that never reads: about one minute
    python -m load_tests fleet bulk               20 robots at their quota beside 200 others: about two minutes
    python -m load_tests fleet chaos              300 robots while gateway and links are killed, cut and stalled: 3 min
    python -m load_tests fleet growth             10, 100, 1,000, 5,000 robots of one load each: about ten minutes
    python -m load_tests fleet transports         what a robot costs this simulator: HTTP/2, grpc.aio, WebSocket

Each writes `.make/fleet/SCENARIO.json` and `.html`; `--quick` is a short sample, `--against FILE.json` compares.
Ctrl-C ends a run early and keeps what was measured. Robots are real but for their disks; see load_tests/fleet/robot.py.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import shlex
import signal
import sys
from collections.abc import Awaitable, Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from load_tests.fleet.bulk import bulk
from load_tests.fleet.chaos import chaos
from load_tests.fleet.growth import growth
from load_tests.fleet.load import Load
from load_tests.fleet.run import Setting
from load_tests.fleet.simulator import TRANSPORTS
from load_tests.fleet.steady import steady
from load_tests.fleet.storm import storm
from load_tests.fleet.transports import transports
from load_tests.fleet.viewers import viewers
from load_tests.report.page import page
from load_tests.report.record import Record, changes, load, machine, save
from metaros.errors import ConfigError

__all__ = ["SCENARIOS", "chosen", "main"]

FOLDER: Final = Path(".make/fleet")
ACTIVE: Final = Load(name="active", period_s=1.0, rows=20, samples=2, sample_bytes=1024)
GROWING: Final = Load(name="growing", rows=20)
WATCHED: Final = Load(name="watched", live_hz=20.0, live_bytes=1024)
HEAVY: Final = Load(name="heavy", period_s=0.25, samples=4, sample_bytes=256 * 1024)
QUOTA_BYTES_PER_S: Final = 1024 * 1024
Scenario = Callable[[Setting, argparse.Namespace, Record], Awaitable[None]]


async def _steady(setting: Setting, options: argparse.Namespace, record: Record) -> None:
    figures: dict[str, Any] = {}
    record.rounds.append(figures)
    await steady(
        setting,
        figures,
        idle=options.idle,
        active=options.active,
        load=replace(ACTIVE, period_s=options.period_s),
        seconds=options.seconds,
        ramp_per_s=options.ramp,
    )


async def _storm(setting: Setting, options: argparse.Namespace, record: Record) -> None:
    for how in options.how.split(","):
        figures: dict[str, Any] = {"name": how}
        record.rounds.append(figures)
        await storm(
            setting,
            figures,
            how=how,
            idle=options.idle,
            active=options.active,
            load=ACTIVE,
            seconds=options.seconds,
            ramp_per_s=options.ramp,
        )


async def _growth(setting: Setting, options: argparse.Namespace, record: Record) -> None:
    sizes = [int(word) for word in options.sizes.split(",")]
    load = replace(GROWING, period_s=options.period_s)
    await growth(setting, record.rounds, sizes=sizes, load=load, seconds=options.seconds, ramp_per_s=options.ramp)


async def _viewers(setting: Setting, options: argparse.Namespace, record: Record) -> None:
    figures: dict[str, Any] = {}
    record.rounds.append(figures)
    await viewers(
        setting,
        figures,
        robots=options.robots,
        viewers=options.viewers,
        load=WATCHED,
        seconds=options.seconds,
        cut_s=options.cut_s,
    )


async def _bulk(setting: Setting, options: argparse.Namespace, record: Record) -> None:
    figures: dict[str, Any] = {}
    record.rounds.append(figures)
    await bulk(
        setting,
        figures,
        honest=options.robots,
        heavy=options.heavy,
        load=ACTIVE,
        heavy_load=HEAVY,
        quota_bytes_per_s=QUOTA_BYTES_PER_S,
        seconds=options.seconds,
        outage_s=options.seconds / 2,
    )


async def _chaos(setting: Setting, options: argparse.Namespace, record: Record) -> None:
    figures: dict[str, Any] = {}
    record.rounds.append(figures)
    await chaos(
        setting,
        figures,
        idle=options.idle,
        active=options.active,
        load=ACTIVE,
        acts=options.acts,
        pause_s=options.seconds,
    )


async def _transports(setting: Setting, options: argparse.Namespace, record: Record) -> None:
    await transports(
        setting, record.rounds, idle=options.idle, active=options.active, load=ACTIVE, seconds=options.seconds
    )


# scenario: what runs it, its title, its options with defaults, and those of --quick
SCENARIOS: Final[dict[str, tuple[Scenario, str, dict[str, Any], dict[str, Any]]]] = {
    "steady": (
        _steady,
        "Many robots on one gateway",
        {"idle": 5000, "active": 500, "seconds": 60.0, "ramp": 100.0, "heartbeat_s": 15.0, "period_s": 2.0},
        {"idle": 90, "active": 10, "seconds": 3.0, "period_s": 1.0},
    ),
    "storm": (
        _storm,
        "All links end at once",
        {"idle": 900, "active": 100, "seconds": 10.0, "ramp": 100.0, "how": "kill,cut"},
        {"idle": 45, "active": 5, "seconds": 1.0, "how": "kill"},
    ),
    "viewers": (
        _viewers,
        "People who watch",
        {"robots": 20, "viewers": 100, "seconds": 20.0, "cut_s": 25.0},
        {"robots": 3, "viewers": 6, "seconds": 3.0, "cut_s": 3.0},
    ),
    "bulk": (
        _bulk,
        "Some who send more than they may",
        {"robots": 200, "heavy": 20, "seconds": 20.0},
        {"robots": 10, "heavy": 2, "seconds": 3.0},
    ),
    "chaos": (
        _chaos,
        "Gateway and links killed, cut and stalled",
        {"idle": 200, "active": 100, "acts": 20, "seconds": 4.0},
        {"idle": 10, "active": 10, "acts": 2, "seconds": 1.0},
    ),
    "transports": (
        _transports,
        "What the simulator itself costs",
        {"idle": 250, "active": 50, "seconds": 15.0},
        {"idle": 10, "active": 5, "seconds": 2.0},
    ),
    "growth": (
        _growth,
        "What a robot costs among many",
        {"sizes": "10,100,1000,5000", "seconds": 40.0, "ramp": 100.0, "heartbeat_s": 15.0, "period_s": 20.0},
        {"sizes": "5,20", "seconds": 2.0, "period_s": 1.0},
    ),
}


def chosen(argv: list[str]) -> argparse.Namespace:
    """The options, with a scenario's own defaults."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenario", nargs="?", choices=sorted(SCENARIOS), help="without one: a short steady")
    parser.add_argument("--idle", type=int, help="robots with heartbeats and statistics alone")
    parser.add_argument("--active", type=int, help="robots that also hand over rows and samples")
    parser.add_argument("--robots", type=int, help="of viewers: those that are watched; of bulk: the honest ones")
    parser.add_argument("--viewers", type=int, help="of viewers: how many watch")
    parser.add_argument("--heavy", type=int, help="of bulk: robots over their quota")
    parser.add_argument("--cut-s", type=float, help="of viewers: how long the one that never reads may stay")
    parser.add_argument("--acts", type=int, help="of chaos: how many times something breaks")
    parser.add_argument("--seconds", type=float, help="how long each phase is measured")
    parser.add_argument("--ramp", type=float, help="robots that come a second")
    parser.add_argument("--sizes", help="of growth: numbers of robots, with commas")
    parser.add_argument(
        "--period-s", type=float, help="of steady and growth: how often a busy robot hands over a batch"
    )
    parser.add_argument("--heartbeat-s", type=float, help="--heartbeat-s of the gateway; without it 5")
    parser.add_argument("--how", help="of storm: kill, restart, cut, with commas")
    parser.add_argument("--transport", choices=sorted(TRANSPORTS), default="grpc", help="how the simulator connects")
    parser.add_argument("--store", default="", metavar="URL", help="PostgreSQL; a file of SQLite without it")
    parser.add_argument("--core", type=int, help="the only core that the gateway may use")
    parser.add_argument("--quick", action="store_true", help="small and short, to see that it runs")
    parser.add_argument("--json", type=Path, metavar="FILE", help="where the figures go; .make/fleet/SCENARIO.json")
    parser.add_argument("--html", type=Path, metavar="FILE", help="where the page goes; beside the figures")
    parser.add_argument("--against", type=Path, metavar="FILE", help="an earlier report's JSON, to compare with")
    parser.add_argument("--quiet", action="store_true", help="no progress")
    options = parser.parse_args(argv)
    if options.scenario is None:
        options.scenario, options.quick = "steady", True
    _, _, defaults, quick = SCENARIOS[options.scenario]
    for name, value in {**defaults, **(quick if options.quick else {})}.items():
        if getattr(options, name, None) is None:
            setattr(options, name, value)
    options.json = options.json or FOLDER / f"{options.scenario}{'-quick' if options.quick else ''}.json"
    options.html = options.html or options.json.with_suffix(".html")
    return options


def raise_file_limit() -> None:
    """Every robot has three connections here; where the system lets a process, it may have as many as it may."""
    try:
        import resource
    except ImportError:  # not on Windows
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != hard:
        with contextlib.suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))


def run_loop(work: Awaitable[None]) -> None:
    """uvloop where there is one: the simulator's own share is half of what it is without."""

    async def whole() -> None:
        await work

    try:
        import uvloop
    except ImportError:
        asyncio.run(whole())
    else:
        uvloop.run(whole())


def main(argv: list[str]) -> int:
    """Run, write the report, print what it comes to; 1 when a goal was missed."""
    options = chosen(argv)
    before = None
    if options.against is not None:
        try:
            before = load(options.against)
        except (OSError, ValueError, TypeError) as error:
            print(f"--against {options.against} is no report: {error}", file=sys.stderr)
            return 2
    scenario, title, _, _ = SCENARIOS[options.scenario]
    command = "python -m load_tests fleet " + shlex.join(argv)
    record = Record(options.scenario, title, command.strip(), machine())
    beat = ("--heartbeat-s", f"{options.heartbeat_s:g}") if options.heartbeat_s is not None else ()
    setting = Setting(transport=options.transport, store_url=options.store, core=options.core, gateway_options=beat)
    raise_file_limit()
    for number in (signal.SIGINT, signal.SIGTERM):  # also where a shell started it in the background
        signal.signal(number, signal.default_int_handler)
    try:
        run_loop(scenario(replace(setting, quiet=options.quiet), options, record))
    except KeyboardInterrupt:
        record.interrupted = True
    except (ConfigError, RuntimeError) as error:
        print(f"the run ended: {error}", file=sys.stderr)
        record.notes.append(f"The run ended early: {error}")
        record.interrupted = True
    save(record, options.json)
    options.html.write_text(page(record, before))
    return conclude(record, before, options)


def conclude(record: Record, before: Record | None, options: argparse.Namespace) -> int:
    """The last lines: goals, what changed, where the report is."""
    goals = [(figures.get("name", ""), goal) for figures in record.rounds for goal in figures.get("goals", ())]
    for name, goal in goals:
        print(f"{'PASS' if goal['met'] else 'FAIL'}  {name + ': ' if name else ''}{goal['text']}")
    for change in changes(before, record) if before is not None else ():
        print(
            f"{change.arrow:>7} {change.ratio:6.2f}  {change.round}: {change.figure} "
            f"{change.before:.3g} -> {change.after:.3g} {change.unit}"
        )
    print(f"report: {options.html}, figures: {options.json}")
    return int(record.interrupted or not all(goal["met"] for _, goal in goals))


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
