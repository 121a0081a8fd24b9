"""A node's two sides: what is wanted, what is said, and in words why they differ."""

from __future__ import annotations

from typing import Any

from gateway.domain.fleet.node import NodeState, TwinStanding, node_state
from metaros.fleet.twin import parse
from metaros.fleet.twin.document import NodeSpec


def wanted(**row: Any) -> NodeSpec:
    nodes = parse({"nodes": {"lidar": {"bundle": "lidar", "version": "1.2.0", **row}}}).nodes
    assert nodes is not None
    return nodes["lidar"]


def standing(**facts: Any) -> TwinStanding:
    known = {"robot": "r1", "online": True, "reported_ns": 1, "revision": 7, "applied": 7, "state": "applied"}
    return TwinStanding(**{**known, "namespace": "/r1", **facts})


def shown(
    desired: NodeSpec | None, reported: dict[str, Any] | None, *, holder: str | None = None, **facts: Any
) -> NodeState:
    return node_state("lidar", desired, reported, standing(**facts), holder=holder)


def said(state: str = "running", **facts: Any) -> dict[str, Any]:
    return {"state": state, "version": "1.2.0", "nice": 0, **facts}


def test_what_is_as_wanted_differs_in_nothing() -> None:
    assert shown(wanted(), said()).differs == ()
    assert shown(wanted(run=False), said("stopped", why="not to run")).differs == ()
    assert shown(wanted(run=False), None).differs == ()
    assert shown(wanted(restart="on-failure"), said("ended", last_exit="exited")).differs == ()
    assert shown(wanted(migratable=True), said("stopped", why="no lease"), holder="r2").differs == ()
    assert shown(None, said(), manages=False).differs == ()
    assert shown(wanted(), said()).ros_name == "/r1/lidar"
    assert node_state("lidar", wanted(), said(), standing(namespace="/")).ros_name == "/lidar"


WHYS: list[tuple[dict[str, Any], dict[str, Any] | None, dict[str, Any], tuple[str, str]]] = [
    ({}, said("quarantined", crashes=5, last_exit="exit code 3"), {}, ("state", "after 5 crashes: exit code 3")),
    ({}, said("blocked", waits_for="base, camera"), {}, ("state", "waits for base, camera")),
    ({}, said("stopped", why="by hand"), {}, ("state", "stopped by hand on the robot")),
    ({}, said("waiting", last_exit="killed by SIGKILL"), {}, ("state", "started again soon: killed by SIGKILL")),
    ({}, said("ended", last_exit="exit code 78"), {}, ("state", "it ended: exit code 78")),
    ({}, said("hung"), {}, ("state", "gives no sign")),
    ({"migratable": True}, said("stopped", why="no lease"), {}, ("state", "waits for its lease")),
    ({}, said("refused", last_exit="no such bundle"), {}, ("state", "no such bundle")),
    ({"run": False}, said(), {"applied": 6}, ("state", "revision 7 is on its way")),
    ({"run": False}, said(), {"online": False, "applied": 6}, ("state", "offline")),
    ({}, None, {"reported_ns": 0, "applied": 0, "state": ""}, ("absent", "never reported")),
    ({}, None, {"applied": 6, "state": "refused", "message": "lidar: no"}, ("absent", "refused revision 7: lidar: no")),
    ({}, None, {"applied": 6, "state": "reverted", "message": "late"}, ("absent", "went back from revision 7: late")),
    (
        {},
        said(version="1.1.0", update={"state": "downloading", "version": "1.2.0", "code": "", "message": ""}),
        {},
        ("version", "downloading 1.2.0"),
    ),
    ({"nice": 5}, said(), {}, ("nice", "not yet")),
]


def test_each_difference_says_why() -> None:
    failures = []
    for row, reported, facts, (what, why) in WHYS:
        differences = shown(wanted(**row), reported, **facts).differs
        if [one.what for one in differences] != [what] or why not in differences[0].why:
            failures.append((row, what, why, differences))
    assert failures == []


def test_a_node_that_the_twin_does_not_name_is_extra() -> None:
    (difference,) = shown(None, said()).differs
    assert (difference.what, difference.desired, difference.reported) == ("extra", None, "running")


def test_who_has_the_lease_is_wanted_to_run() -> None:
    assert shown(wanted(migratable=True), said(), holder="r1").wanted == "running"
    remote = shown(wanted(migratable=True), said(), holder="r2")
    assert (remote.wanted, remote.differs[0].desired) == ("standby", "standby")


def test_a_robot_may_say_what_it_likes() -> None:
    odd = {"state": ["x"], "version": {"a": 1}, "nice": "low", "update": 7, "why": None, "crashes": "many"}
    whats = {item.what for item in shown(wanted(), odd).differs}
    assert whats == {"state", "version", "nice"}
