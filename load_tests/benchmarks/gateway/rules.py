"""How long one event takes to find its rules among a thousand, and what it takes to ask each instead."""

from __future__ import annotations

import argparse
import json
import random
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from load_tests.figures import note
from metaros.automation.rules.index import PatternIndex
from metaros.automation.rules.pattern import Pattern, compile_pattern

__all__ = ["Figures", "events", "main", "measure", "moto_us", "rules"]

KINDS = ("robot.connected", "robot.disconnected", "node.state", "alert.raised", "command.done", "recording.complete")
Document = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Figures:
    """Of one set of rules: microseconds an event, at the index and one rule after the other; how many rules matched."""

    rules: int
    index_p50_us: float
    index_p99_us: float
    each_p50_us: float
    matches: float
    put_us: float


def rules(count: int, rng: random.Random) -> list[Document]:
    """Patterns as a fleet has them: by type and robot, by thresholds, by parts of names, by what is not."""
    makers = (
        [_by_robot] * 8
        + [_by_threshold] * 4
        + [_by_name] * 3
        + [_by_severity] * 2
        + [_by_either, _by_refusal, _by_case]
    )
    return [rng.choice(makers)(rng) for _ in range(count)]


def events(count: int, rng: random.Random) -> list[Document]:
    """Events that such rules are about."""
    return [_event(rng) for _ in range(count)]


def measure(*, count: int = 1000, event_count: int = 2000, seed: int = 11) -> Figures:
    """Both ways over the same rules and events; AssertionError if they do not find the same."""
    rng = random.Random(seed)
    patterns = {f"rule-{number}": compile_pattern(rule) for number, rule in enumerate(rules(count, rng))}
    index, asked = PatternIndex(), events(event_count, rng)
    began = time.perf_counter()
    for key, pattern in patterns.items():
        index.put(key, pattern)
    put_us = (time.perf_counter() - began) / count * 1e6
    found = [index.match(event) for event in asked]
    few = asked[:50]
    assert [sorted(keys) for keys in found[:50]] == [sorted(_each(patterns, event)) for event in few]
    fast = _timed(index.match, asked)
    slow = _timed(lambda event: _each(patterns, event), few)
    return Figures(
        rules=count,
        index_p50_us=statistics.median(fast),
        index_p99_us=statistics.quantiles(fast, n=100)[98],
        each_p50_us=statistics.median(slow),
        matches=statistics.fmean(map(len, found)),
        put_us=put_us,
    )


def _each(patterns: dict[str, Pattern], event: Document) -> list[str]:
    return [key for key, pattern in patterns.items() if pattern.matches(event)]


def _timed(ask: Callable[[Document], object], asked: list[Document]) -> list[float]:
    times_us = []
    for event in asked:
        began = time.perf_counter()
        ask(event)
        times_us.append((time.perf_counter() - began) * 1e6)
    return times_us


def _robot(rng: random.Random) -> str:
    return f"robot-{rng.randrange(200):03}"


def _by_robot(rng: random.Random) -> Document:
    return {"detail-type": [f"metaros.{rng.choice(KINDS)}"], "detail": {"robot": [_robot(rng)]}}


def _by_threshold(rng: random.Random) -> Document:
    signs = [rng.choice(["<", "<="]), rng.uniform(5, 60)]
    detail: Document = {"data": {"percentage": [{"numeric": signs}]}}
    if rng.random() < 0.8:
        detail["robot"] = [_robot(rng)]
    return {"detail-type": ["metaros.topic.message"], "detail": {"topic": ["battery"], **detail}}


def _by_name(rng: random.Random) -> Document:
    part = f"{rng.choice(['arm', 'base', 'lidar', 'camera', 'imu'])}_{rng.randrange(40)}"
    entry = rng.choice([{"prefix": part}, {"suffix": part}, {"wildcard": f"*/{part}/*"}, {"wildcard": f"{part}/*"}])
    return {"source": ["metaros"], "detail": {"node": [entry]}}


def _by_severity(rng: random.Random) -> Document:
    robot = {"prefix": f"robot-{rng.randrange(20):02}"}
    levels = rng.sample(["info", "warning", "error", "critical"], 2)
    return {"detail-type": ["metaros.alert.raised"], "detail": {"severity": levels, "robot": [robot]}}


def _by_either(rng: random.Random) -> Document:
    either = [{"robot": [_robot(rng)]}, {"node": [f"arm_{rng.randrange(40)}"], "state": ["crashed"]}]
    return {"detail-type": ["metaros.node.state"], "detail": {"$or": either}}


def _by_refusal(rng: random.Random) -> Document:
    detail = {
        "state": [{"anything-but": ["active", "inactive"]}],
        "robot": [_robot(rng)],
        "silenced": [{"exists": False}],
    }
    return {"detail-type": ["metaros.node.state"], "detail": detail}


def _by_case(rng: random.Random) -> Document:
    return {"detail-type": ["metaros.command.done"], "detail": {"robot": [{"equals-ignore-case": _robot(rng).upper()}]}}


def _event(rng: random.Random) -> Document:
    kind = rng.choice([*KINDS, "topic.message", "topic.message"])
    detail: Document = {"robot": _robot(rng), "severity": rng.choice(["info", "warning", "error", "critical"])}
    detail |= {
        "node": f"{rng.choice(['arm', 'base', 'lidar'])}_{rng.randrange(40)}/driver",
        "state": rng.choice(["active", "crashed"]),
    }
    if kind == "topic.message":
        detail |= {
            "topic": "battery",
            "data": {"percentage": rng.uniform(0, 100), "voltage": 24.1, "cell_voltage": [3.7] * 12},
        }
    return {
        "version": "0",
        "id": f"e-{rng.randrange(10**6)}",
        "detail-type": f"metaros.{kind}",
        "source": "metaros",
        "account": "000000000000",
        "time": "2026-11-22T18:00:00Z",
        "region": "local",
        "resources": [f"arn:metaros:robot:{detail['robot']}"],
        "detail": detail,
    }


if __name__ == "__main__":
    for size in (100, 1000, 10_000):
        print(measure(count=size))


def main(argv: Sequence[str] = ()) -> int:
    """Print rounds with 1,000 and 10,000 rules, and one match beside moto's; 1 when 1,000 rules take over the goal."""
    parser = argparse.ArgumentParser(prog="python -m load_tests rules")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--goal-us", type=float, default=150.0)
    chosen = parser.parse_args(argv)
    middle = 0.0
    print(f"{'rules':>8}{'p50 us':>10}{'p99 us':>10}{'each asked us':>16}{'moto each us':>14}{'matches':>10}")
    for count in (1000, 10_000):
        found = [measure(count=count, seed=seed) for seed in range(chosen.rounds)]
        theirs = [
            moto_us(count=min(count, 1000), seed=seed) * count / min(count, 1000) for seed in range(chosen.rounds)
        ]
        note(f"one event, {count:,} rules", [item.index_p50_us for item in found], peer=theirs)
        middle = middle or statistics.median(item.index_p50_us for item in found)
        columns = (
            statistics.median(item.index_p50_us for item in found),
            statistics.median(item.index_p99_us for item in found),
            statistics.median(item.each_p50_us for item in found),
            statistics.median(theirs),
            statistics.median(item.matches for item in found),
        )
        print(
            f"{count:>8}"
            + "".join(f"{value:>{width}.1f}" for value, width in zip(columns, (10, 10, 16, 14, 10), strict=True))
        )
    held = "yes" if middle <= chosen.goal_us else "NO"
    print(f"\n{held}: 1,000 rules and one event in {middle:.0f} us (goal {chosen.goal_us:.0f})")
    return int(middle > chosen.goal_us)


def moto_us(*, count: int, seed: int) -> float:
    """What moto's matcher takes to ask each rule, microseconds an event."""
    from moto.events.models import EventPattern  # a development dependency; slow to import

    rng = random.Random(seed)
    patterns = [EventPattern.load(json.dumps(rule)) for rule in rules(count, rng)]
    return statistics.median(_timed(lambda event: [item.matches_event(event) for item in patterns], events(20, rng)))
