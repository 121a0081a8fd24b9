"""Topics of types that only their node knows are recorded with them, and played for who has never seen them."""

from __future__ import annotations

from collections import OrderedDict
from pathlib import Path
from typing import Any

import pytest

import metaros
from metaros.idl import known, type_hash
from metaros.interfaces.std_msgs.msg import String
from metaros.record import Player, Recorder, open_bag
from metaros.record.type_teller import TypeTeller
from metaros.wire import qos_transient_local
from tests.support.nodes.bags import arrivals, write_bag
from tests.support.nodes.typed_peer import TypedPeer, typed_peer
from tests.support.waiting import wait_until

WAIT_S = 60.0
TEXTS = {
    "gait_msgs/msg/Leg": "uint8 LEFT=1\nstring<=8 name\nfloat32[] angles\n",
    "gait_msgs/action/Step": "Leg leg\n---\n---\nLeg now\n",
}
LEG, FEEDBACK = "gait_msgs/msg/Leg", "gait_msgs/action/Step_FeedbackMessage"


def walk(peer: TypedPeer) -> None:
    """A latched message, and feedback that comes with no goal."""
    leg, peer.type_of_step = peer.type(LEG), peer.type("gait_msgs/action/Step")  # type: ignore[attr-defined]
    latched = peer.node.create_publisher(leg, "/leg", qos_transient_local)
    latched.publish(leg(name="left", angles=[0.5, 1.5]))
    server = peer.node.create_action_server(peer.type_of_step, "/step", lambda goal: goal.succeed())  # type: ignore[attr-defined]
    message = server._types.feedback(feedback=peer.type_of_step.Feedback(now=leg(name="right")))  # type: ignore[attr-defined]
    peer.node.create_timer(0.02, lambda: server._feedback.publish(message))


def test_what_was_recorded_is_played_with_its_type(
    contexts: tuple[metaros.Context, metaros.Context], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "run"
    with typed_peer(contexts[0], "walker", TEXTS, walk, monkeypatch) as peer:
        topics = ["/leg", "/step/_action/feedback"]
        with Recorder(contexts[1], folder, topics=topics, hidden=True) as recorder:
            wait_until(lambda: recorder.report().received >= 3, timeout_s=WAIT_S)
            wait_until(lambda: all(schemas_of(recorder)), timeout_s=WAIT_S)
        hashes = {name: type_hash(name, peer.catalogue) for name in (LEG, FEEDBACK)}
    monkeypatch.setattr(known, "_known", OrderedDict())
    bag = open_bag(folder)
    assert {topic.type_name: topic.type_hash for topic in bag.topics} == hashes
    decoded = {message.topic.type_name: message.decode() for message in bag.messages()}
    assert (decoded[LEG].name, decoded[FEEDBACK].feedback.now.name) == ("left", "right")

    with metaros.Node("asker", context=contexts[0]) as node, Player(contexts[1], bag, rate=0.0) as player:
        monkeypatch.setattr(known, "_known", Forgetful(known._known))
        leg = node.fetch_interface(LEG, timeout_s=WAIT_S)
        got: list[Any] = []
        node.create_subscription(leg, "/leg", got.append, qos_transient_local, dedicated=True)
        player.play(wait_subscriber_s=0.0)
        wait_until(lambda: got, timeout_s=WAIT_S)
    assert (got[0].name, leg.LEFT, leg.__metaros_hash__) == ("left", 1, hashes[LEG])


class Forgetful(OrderedDict[Any, Any]):
    """What the player knows is told by its node, and not found by who looks itself: two programs share this process."""

    def __init__(self, told: OrderedDict[Any, Any]) -> None:
        super().__init__(told)
        self.asked = 0

    def get(self, key: Any, default: Any = None) -> Any:
        self.asked += 1
        return default if self.asked == 1 else super().get(key, default)


def schemas_of(recorder: Recorder) -> list[Any]:
    """Those of the topics so far."""
    routes = list(recorder._tap.routes.values())
    return [route.schema for route in routes] if len(routes) == 2 else [None]


def test_types_that_every_program_has_need_no_teller(
    contexts: tuple[metaros.Context, metaros.Context], tmp_path: Path
) -> None:
    write_bag(tmp_path / "a.mcap", arrivals("/chatter", [String(data="x")]))
    with metaros.Node("quiet", context=contexts[0], enable_parameters=False) as node:
        teller = TypeTeller(node, open_bag(tmp_path / "a.mcap").topics)
        assert node.graph.endpoints("/quiet/get_type_description") == []
        teller.close()
        teller.close()
