"""Topics whose publishers are gone: they stay tapped for a while, and no longer."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from edge_agent.config.topic_table import TopicTable
from edge_agent.forwarding.channels import Channels
from edge_agent.forwarding.scope import Scope
from edge_agent.forwarding.tap import KEEP_S, Tap
from metaros.clock import ManualClock
from metaros.idl import type_hash
from metaros.wire import EndpointInfo, QoSProfile
from tests.edge_agent.parts import make_outbox

STRING = "std_msgs/msg/String"


class Subscriptions:
    """A node that only notes what it subscribes, with a graph that is as it is told."""

    full_name = "/sim_1/agent"

    def __init__(self) -> None:
        self.context = SimpleNamespace(zid="us")
        self.graph = self
        self.shown: list[EndpointInfo] = []
        self.open: list[str] = []

    def on_change(self, _look: object) -> None:
        """The test says when to look."""

    def endpoints(self, topic: str | None = None, kind: str | None = None) -> list[EndpointInfo]:
        return [one for one in self.shown if topic in (None, one.topic) and kind in (None, one.kind)]

    def create_raw_subscription(self, name: str, *_: object) -> Any:
        self.open.append(name)
        return SimpleNamespace(close=lambda: self.open.remove(name))


def publisher(topic: str) -> EndpointInfo:
    return EndpointInfo(
        kind="MP",
        node="base",
        namespace="/sim_1",
        topic=topic,
        type_name=STRING,
        type_hash=type_hash(STRING),
        qos=QoSProfile(),
        qos_text="",
        gid=topic.encode(),
        zid="they",
        backends=None,
    )


async def test_a_topic_that_stays_silent_is_let_go_and_one_that_comes_back_begins_anew(clock: ManualClock) -> None:
    node: Any = Subscriptions()
    gone, back = publisher("/sim_1/gone"), publisher("/sim_1/back")
    node.shown = [gone, back]
    channels = Channels(TopicTable(), make_outbox().ids, namespace="/sim_1")
    tap = Tap(node, channels, Scope("/sim_1"), lambda arrivals, now_s: None, lambda: None, clock)
    opened: list[list[str]] = [list(node.open)]
    for shown, after_s in (
        ([], 0.0),  # both fall silent
        ([], KEEP_S - 1.0),
        ([back], 0.5),
        ([], 0.5),  # one for KEEP_S, the other since now
        ([], KEEP_S - 0.5),
        ([gone], 0.0),
        ([gone], 0.5),
    ):
        node.shown = shown
        clock.advance(after_s)
        tap.reconcile()
        opened.append(list(node.open))
    both, alone, anew = ["/sim_1/gone", "/sim_1/back"], ["/sim_1/back"], ["/sim_1/back", "/sim_1/gone"]
    assert opened == [both, both, both, both, alone, alone, anew, ["/sim_1/gone"]]
    assert tap._due is None  # nothing is silent: no other look is planned
    tap.close()
    assert node.open == []
