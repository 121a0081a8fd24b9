"""A robot's graph from what REST tells of it: the same answers as those of this machine's graph."""

from __future__ import annotations

from typing import Any

from metaros.cli.graph.model import build_graph_model
from metaros.cli.remote.graph import RemoteGraph
from metaros.wire import QoSProfile, Reliability

BEST_EFFORT = QoSProfile(reliability=Reliability.BEST_EFFORT).encode()
STRING, TRIGGER = "std_msgs/msg/String", "std_srvs/srv/Trigger"


def end(node: str, type_name: str, qos: str = "") -> dict[str, Any]:
    """One endpoint."""
    return {"node": node, "type": type_name, "type_hash": "RIHS01_" + "0" * 64, "qos": qos or QoSProfile().encode()}


DOCUMENT: dict[str, Any] = {
    "robot": "r1",
    "revision": 3,
    "nodes": ["/r1/talker", "/r1/listener"],
    "topics": [
        {
            "topic": "/r1/chatter",
            "types": [STRING],
            "publishers": [end("/r1/talker", STRING, BEST_EFFORT)],
            "subscribers": [end("/r1/listener", STRING), end("", STRING)],
        }
    ],
    "services": [{"service": "/r1/reset", "type": TRIGGER, "servers": [end("/r1/talker", TRIGGER)], "clients": []}],
    "actions": [
        {"action": "/r1/dock", "type": "nav_msgs/action/Dock", "servers": ["/r1/talker"], "clients": ["/r1/listener"]}
    ],
    "left_out": 0,
}


def test_names_types_and_ends() -> None:
    graph = RemoteGraph(DOCUMENT)
    assert [node.full_name for node in graph.nodes()][-2:] == ["/r1/listener", "/r1/talker"]
    assert graph.topics() == {"/r1/chatter": {STRING}}
    assert graph.services()["/r1/reset"] == {TRIGGER}
    assert [item.node_full_name for item in graph.endpoints("/r1/chatter", "MP")] == ["/r1/talker"]
    assert len(graph.endpoints("/r1/chatter", "MS")) == 2
    assert graph.wait_for(lambda: True, 0.0)


def test_actions_and_what_does_not_match_are_drawn_as_at_home() -> None:
    links = {link.name: link for link in build_graph_model([], RemoteGraph(DOCUMENT).tokens()).links}
    assert links["/r1/dock"].kind == "action"
    assert links["/r1/dock"].types == ("nav_msgs/action/Dock",)
    assert (links["/r1/dock"].sources, links["/r1/dock"].sinks) == (("/r1/talker",), ("/r1/listener",))
    fault = links["/r1/chatter"].fault("/r1/talker", "/r1/listener")
    assert fault is not None
    assert fault.code == "qos_mismatch"


def test_an_agent_that_tells_nothing_has_an_empty_graph() -> None:
    empty = RemoteGraph({"nodes": [], "topics": [], "services": [], "actions": []})
    assert (empty.nodes(), empty.endpoints(), empty.tokens()) == ([], [], [])
