"""A rollout by its facts alone: waves, failures, halts and ends; and what holds whatever robots do."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.domain.fleet import rollout as engine
from gateway.domain.fleet.rollout import Facts, Plan, Rollout, wave_sizes

S = 10**9
ONLINE = Facts(online=True)
GOOD = Facts(online=True, good=True)


def plan(**changes: Any) -> Plan:
    return Plan(**{"kind": "agent", "node": "", "bundle": "metaros", "version": "2.0.0", "selector": "", **changes})


def begun(robots: int, **changes: Any) -> Rollout:
    names = [f"r{number}" for number in range(robots)]
    return engine.begin("ro1", plan(**changes), names, now_ns=0, created_by="ann")


def facts_of(rollout: Rollout, some: Mapping[str, Facts], rest: Facts = ONLINE) -> dict[str, Facts]:
    return {robot: some.get(robot, rest) for robot in rollout.members}


def names(rollout: Rollout, state: str) -> list[str]:
    return sorted(robot for robot, member in rollout.members.items() if member.state == state)


def turn(rollout: Rollout, some: Mapping[str, Facts], now_ns: int, rest: Facts = ONLINE) -> Rollout:
    """A step, after which every twin that is to hold the version holds it."""
    rollout = engine.step(rollout, facts_of(rollout, some, rest), now_ns)
    for robot in names(rollout, "starting"):
        rollout = engine.assigned(rollout, robot, now_ns)
    return rollout


@pytest.mark.parametrize(
    ("waves", "robots", "sizes"),
    [
        (("1", "10%", "50%", "100%"), 20, (1, 1, 8, 10)),
        (("2", "6"), 20, (2, 6, 12)),
        (("5%", "100%"), 3, (1, 2)),
        (("100%",), 7, (7,)),
        (("30",), 7, (7,)),
        (("10%", "10%"), 100, (10, 90)),
        (("1",), 0, ()),
    ],
)
def test_sizes_of_waves(waves: tuple[str, ...], robots: int, sizes: tuple[int, ...]) -> None:
    assert wave_sizes(waves, robots) == sizes


@pytest.mark.parametrize("wave", ["0", "101%", "-1", "1.5", "", "%", "x", "１", "9" * 7])
def test_what_is_no_wave(wave: str) -> None:
    with pytest.raises(ValueError, match="wave"):
        wave_sizes((wave,), 10)


def test_wave_after_wave_until_all_have_it() -> None:
    ro = begun(20, waves=("2", "6"), steady_s=0.0)
    sizes = []
    for second in range(10):
        ro = turn(ro, dict.fromkeys(names(ro, "updating"), GOOD), second * S)
        sizes.append(len(names(ro, "updating")))
        if ro.state != "running":
            break
    assert sizes == [2, 6, 12, 0]
    assert (ro.state, ro.reason, len(names(ro, "done"))) == ("done", "", 20)


def test_it_halts_by_itself_and_goes_on_with_a_fix() -> None:
    ro = turn(begun(20, waves=("2", "6"), steady_s=0.0), {}, 0)
    ro = turn(ro, dict.fromkeys(names(ro, "updating"), GOOD), 1 * S)
    bad = names(ro, "updating")[:2]
    ro = turn(ro, {bad[0]: Facts(online=True, failure="rolled_back: no heartbeat")}, 2 * S)
    assert ro.state == "halted"  # one of six is more than 10 %
    assert f"wave 2: 1 failed, at most 0 may: {bad[0]} rolled_back: no heartbeat" in ro.reason
    ro = turn(ro, {bad[1]: Facts(online=True)}, 900 * S)  # those at it settle; nobody else is told
    assert set(bad) <= set(names(ro, "failed"))
    assert "not healthy within 600 s" in ro.members[bad[1]].reason
    assert len(names(ro, "waiting")) == 12
    with pytest.raises(ValueError, match="the version that failed"):
        engine.resume(ro, 901 * S, version="2.0.0")
    ro = engine.resume(ro, 901 * S, version="2.0.1")
    assert (ro.plan.version, ro.wave, len(names(ro, "waiting"))) == ("2.0.1", 1, 20)
    for second in range(902, 910):
        ro = turn(ro, dict.fromkeys(names(ro, "updating"), GOOD), second * S)
    assert (ro.state, len(names(ro, "done"))) == ("done", 20)


def test_resumed_in_spite_of_failures() -> None:
    ro = turn(begun(4, waves=("2",), steady_s=0.0), {}, 0)
    first, second = names(ro, "updating")
    ro = turn(ro, {first: Facts(online=True, failure="refused"), second: GOOD}, S)
    assert ro.state == "halted"
    ro = turn(engine.resume(ro, 2 * S), {}, 2 * S)
    assert (ro.state, ro.wave, len(names(ro, "updating"))) == ("running", 2, 2)
    ro = turn(ro, {names(ro, "updating")[0]: Facts(online=True, failure="refused")}, 3 * S)
    assert ro.state == "halted"  # the pardon was for the wave before


def test_offline_robots_hold_nobody_up() -> None:
    ro = begun(10, waves=("1", "50%"), steady_s=0.0)
    away = set(names(ro, "waiting")[:4])
    off = dict.fromkeys(away, Facts(online=False))
    for second in range(8):
        ro = turn(ro, off | dict.fromkeys(names(ro, "updating"), GOOD), second * S)
    assert (ro.state, len(names(ro, "done")), set(names(ro, "waiting"))) == ("running", 6, away)
    back = away.pop()
    ro = turn(ro, {**off, back: ONLINE}, 20 * S)
    assert names(ro, "updating") == [back]
    ro = turn(ro, {**off, back: GOOD}, 21 * S)
    ro = turn(ro, off, 8 * 86_400 * S)
    assert (ro.state, set(names(ro, "unreached"))) == ("done", away)


def test_a_robot_may_be_away_for_a_while() -> None:
    ro = turn(begun(1), {}, 0)
    gone = {"r0": Facts(online=False, offline_since_ns=5 * S)}
    assert turn(ro, gone, 300 * S).state == "running"
    halted = turn(ro, gone, 306 * S)
    assert "offline for more than 300 s" in halted.reason


def test_good_for_a_moment_is_not_good() -> None:
    ro = turn(begun(1), {}, 0)
    for second in range(0, 30, 2):  # good, and not, in turn: a node that keeps ending
        ro = turn(ro, {"r0": GOOD if second % 4 else ONLINE}, second * S)
    assert ro.members["r0"].state == "updating"
    for second in range(30, 41, 5):
        ro = turn(ro, {"r0": GOOD}, second * S)
    assert ro.state == "done"


def test_paused_and_aborted() -> None:
    ro = turn(begun(4, waves=("2",), steady_s=0.0), {}, 0)
    ro = engine.pause(ro, "lunch", S)
    ro = turn(ro, dict.fromkeys(names(ro, "updating"), GOOD), 2 * S)
    assert (ro.state, len(names(ro, "done")), len(names(ro, "waiting"))) == ("paused", 2, 2)
    for wrong in (lambda: engine.pause(ro, "", S), lambda: engine.abort(engine.abort(ro, "", S), "", S)):
        with pytest.raises(ValueError, match="it is"):
            wrong()
    assert turn(engine.abort(ro, "enough", 3 * S), {}, 4 * S).members == ro.members


def test_what_a_robot_says_of_itself() -> None:
    agent, node = plan(), plan(kind="node", node="lidar", bundle="lidar-node")

    def of_agent(**said: Any) -> tuple[bool, str]:
        return engine.health_of(agent, {"agent": said})

    assert of_agent(version="2.0.0", update={"state": "healthy", "version": "2.0.0"}) == (True, "")
    assert of_agent(version="2.0.0", update={"state": "trying", "version": "2.0.0"}) == (False, "")
    assert of_agent(version="1.0.0", update={"state": "healthy", "version": "1.0.0"}) == (False, "")
    assert of_agent(version="1.0.0", update={"state": "rolled_back", "version": "1.9.0"}) == (False, "")
    rolled = of_agent(version="1.0.0", update={"state": "rolled_back", "version": "2.0.0", "message": "no link"})
    assert rolled == (False, "rolled_back: no link")
    for reported in (None, {}, {"agent": 3}, {"agent": {"update": []}}):
        assert engine.health_of(agent, reported) == (False, "")

    def of_node(**said: Any) -> tuple[bool, str]:
        return engine.health_of(node, {"nodes": {"lidar": said}})

    assert of_node(version="2.0.0", state="running") == (True, "")
    assert of_node(version="2.0.0", state="restarting") == (False, "")
    assert of_node(version="1.0.0", state="running") == (False, "")
    assert of_node(version="2.0.0", state="quarantined")[1].startswith("quarantined")


FACTS = st.builds(
    Facts,
    online=st.booleans(),
    offline_since_ns=st.integers(0, 4000).map(lambda s: s * S),
    good=st.booleans(),
    failure=st.sampled_from(["", "", "", "", "rolled_back"]),
)
WAVES = st.lists(st.sampled_from(["1", "2", "3", "5%", "10%", "50%", "100%"]), min_size=1, max_size=4).map(tuple)


@settings(max_examples=50)
@given(
    data=st.data(),
    robots=st.integers(0, 25),
    waves=WAVES,
    rate=st.sampled_from([0.0, 0.1, 0.34, 1.0]),
    steady_s=st.sampled_from([0.0, 10.0]),
)
def test_whatever_robots_do(
    data: st.DataObject, robots: int, waves: tuple[str, ...], rate: float, steady_s: float
) -> None:
    ro = begun(robots, waves=waves, max_failure_rate=rate, steady_s=steady_s, give_up_s=5000.0)
    now_s = 0
    for _ in range(data.draw(st.integers(0, 25))):
        now_s += data.draw(st.integers(0, 400))
        said = {robot: data.draw(FACTS) for robot in ro.members}
        before = ro
        ro = engine.step(ro, said, now_s * S)
        assert ro == engine.step(before, said, now_s * S)
        _check(before, ro, said)
        for robot in names(ro, "starting"):
            if data.draw(st.booleans()):
                ro = engine.assigned(ro, robot, now_s * S)
        if ro.state == "halted" and data.draw(st.booleans()):
            ro = engine.resume(ro, now_s * S, version=data.draw(st.sampled_from(["", "3.0.0"])) or "")
            if ro.plan.version == "3.0.0":
                break
    for _ in range(4 * robots + 4):  # it ends by itself, whatever is left of it, once time goes by
        for robot in names(ro, "starting"):
            ro = engine.assigned(ro, robot, now_s * S)
        now_s += 6000
        ro = engine.step(ro, {}, now_s * S)
        if ro.state == "halted":
            ro = engine.resume(ro, now_s * S)
    assert ro.state == "done"
    assert not names(ro, "waiting")


def _check(before: Rollout, after: Rollout, said: Mapping[str, Facts]) -> None:
    in_flight = after.count("starting", "updating")
    if after.members:
        assert in_flight <= after.sizes[after.wave - 1]
        assert sum(m.wave == after.wave for m in after.members.values()) <= after.sizes[after.wave - 1]
    new = {robot for robot in names(after, "starting") if before.members[robot].state == "waiting"}
    assert all(said[robot].online for robot in new)
    if before.state != "running":
        assert not new
    failed = after.count("failed", wave=after.wave) - after.pardoned
    if after.state == "running" and after.members:
        assert failed <= math.floor(after.plan.max_failure_rate * after.sizes[after.wave - 1] + 1e-9)
    if after.state == "halted" and before.state == "running":
        assert not new
        assert after.reason
    if after.wave > before.wave:  # nobody of an earlier wave is at it still
        assert all(m.wave == after.wave for m in after.members.values() if m.state in ("starting", "updating"))
    kept = {robot: member for robot, member in after.members.items() if robot not in after.changed}
    assert all(before.members[robot] == member for robot, member in kept.items())
