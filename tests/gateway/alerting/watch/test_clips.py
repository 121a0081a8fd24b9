"""Clips: severe alerts get one each, a while after they began, and no robot is asked too often."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import pytest

from gateway.alerting.watch.clips import A_DAY, Clips
from gateway.domain.alert import Alert
from gateway.domain.fleet.recording import REQUESTED, Recording
from gateway.errors import StoreError, TooManyError
from metaros.clock import ManualClock

S = 10**9


@dataclass
class Robots:
    """What was asked of robots, and tied to alerts."""

    asked: list[tuple[str, tuple[int, int]]] = field(default_factory=list)
    tied: list[tuple[str, str]] = field(default_factory=list)
    error: Exception | None = None

    async def request(self, robot: str, span_ns: tuple[int, int]) -> Recording:
        if self.error is not None:
            raise self.error
        self.asked.append((robot, span_ns))
        return Recording(
            id=f"clip {len(self.asked)}", robot=robot, state=REQUESTED, from_ns=span_ns[0], to_ns=span_ns[1],
            topics=(), requested_ns=0, live_ns=0,
        )  # fmt: skip

    async def attach(self, alert_id: str, recording_id: str) -> None:
        self.tied.append((alert_id, recording_id))


def alert(clock: ManualClock, name: str = "A", **fields: str) -> Alert:
    now_ns = clock.wall_ns()
    made = Alert(
        id=name, robot="r1", cause="heat", state="open", severity="error", title="Hot", opened_ns=now_ns,
        first_ns=1000 * S, changed_ns=now_ns, seen_ns=now_ns,
    )  # fmt: skip
    return replace(made, **fields)


async def after(clips: Clips, clock: ManualClock, seconds: float) -> None:
    clock.advance(seconds)
    await clips.step()


async def test_a_severe_alert_gets_a_clip_once_what_came_after_it_is_there() -> None:
    clock, robots = ManualClock(), Robots()
    clips = Clips(robots.request, robots.attach, clock=clock)
    clips.on_alert("opened", alert(clock))
    await after(clips, clock, 10)
    assert robots.asked == []
    await after(clips, clock, 1.5)
    assert robots.asked == [("r1", (970 * S, 1010 * S))]
    assert robots.tied == [("A", "clip 1")]
    await after(clips, clock, 100)
    assert len(robots.asked) == 1


async def test_others_get_none() -> None:
    clock, robots = ManualClock(), Robots()
    clips = Clips(robots.request, robots.attach, clock=clock)
    clips.on_alert("opened", alert(clock, severity="warning"))
    clips.on_alert("resolved", alert(clock))
    clips.on_alert("opened", alert(clock, clip="there is one"))
    clips.on_alert("opened", alert(clock, robot=""))
    await after(clips, clock, 60)
    assert robots.asked == []
    clips.on_alert("escalated", alert(clock))
    await after(clips, clock, 60)
    assert len(robots.asked) == 1


async def test_a_robot_is_asked_once_a_minute_and_twenty_times_a_day() -> None:
    clock, robots = ManualClock(), Robots()
    clips = Clips(robots.request, robots.attach, clock=clock)
    clips.on_alert("opened", alert(clock, "A"))
    clips.on_alert("opened", alert(clock, "B"))
    clips.on_alert("opened", alert(clock, "C", robot="r2"))
    await after(clips, clock, 12)
    assert [alert_id for alert_id, _ in robots.tied] == ["A", "C"]
    assert clips.skipped == 1
    for _ in range(A_DAY - 1):
        clock.advance(61)
        await clips.take(alert(clock))
    clock.advance(61)
    with pytest.raises(TooManyError, match="within a day"):
        await clips.take(alert(clock))
    clock.advance(86_400)
    await clips.take(alert(clock))


async def test_a_store_that_cannot_is_no_end() -> None:
    clock, robots = ManualClock(), Robots(error=StoreError("the disk is full"))
    clips = Clips(robots.request, robots.attach, clock=clock)
    clips.on_alert("opened", alert(clock))
    await after(clips, clock, 12)
    assert robots.tied == []


async def test_alerts_that_had_just_begun_when_a_gateway_ended_get_theirs() -> None:
    clock, robots = ManualClock(), Robots()
    clips = Clips(robots.request, robots.attach, clock=clock)
    clips.resume([alert(clock, opened_ns=clock.wall_ns() - 20 * S), alert(clock, "old", opened_ns=0)])  # type: ignore[arg-type]
    await after(clips, clock, 12)
    assert [alert_id for alert_id, _ in robots.tied] == ["A"]
