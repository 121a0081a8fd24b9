"""Types by asking: messages, services and actions of peers by name alone, and peers that lie about them."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

import metaros
from metaros.errors import UnknownTypeError
from metaros.idl import Catalogue, catalogue_of, message_class, type_hash
from metaros.node.introspection import fetch_type, find_interface
from tests.metaros.node.action.test_actions import spinning
from tests.support.nodes.typed_peer import TypedPeer, catalogue_with, typed_peer
from tests.support.waiting import wait_until

ARM = "arm_msgs/action/Reach"
TEXTS = {
    "arm_msgs/msg/Joint": "float32[<=4] angles\nstring<=8 name\nuint8 MANY=4\n",
    "arm_msgs/srv/Bend": "Joint joint\nint16 times 3\n---\nbool done\nstd_msgs/Header header\n",
    ARM: "Joint[] path\nbyte STRAIGHT=1\n---\nfloat64 error\n---\nJoint now\nstd_msgs/Header header\n",
    "arm_msgs/srv/Nothing": "---\n",
    "arm_msgs/action/Wait": "---\n---\n",
}
OTHER = {"arm_msgs/msg/Joint": "float32[<=4] angles\nstring<=9 name\n"}


def serve(peer: TypedPeer) -> None:
    """A topic, two services and two actions."""
    joint = peer.type("arm_msgs/msg/Joint")
    publisher = peer.node.create_publisher(joint, "/joint")
    peer.node.create_timer(0.02, lambda: publisher.publish(joint(angles=[1.5], name="elbow")))

    def bend(request: Any, response: Any) -> None:
        response.done, response.header.frame_id = request.times == 3, request.joint.name

    def reach(goal: Any) -> Any:
        goal.publish_feedback(action.Feedback(now=goal.request.path[-1]))
        goal.succeed(action.Result(error=len(goal.request.path)))

    peer.node.create_service(peer.type("arm_msgs/srv/Bend"), "/bend", bend)
    peer.node.create_service(peer.type("arm_msgs/srv/Nothing"), "/nothing", lambda request, response: None)
    action = peer.type(ARM)
    peer.node.create_action_server(action, "/reach", reach)
    peer.node.create_action_server(peer.type("arm_msgs/action/Wait"), "/wait", lambda goal: goal.succeed())


@pytest.mark.parametrize(("sources", "whole"), [(True, True), (False, False)])
def test_topics_services_and_actions_are_used_by_name_alone(here, there, monkeypatch, sources, whole):
    with (
        typed_peer(there, "arm", TEXTS, serve, monkeypatch, sources=sources, whole=whole) as peer,
        metaros.Node("asker", context=here) as node,
    ):
        found = find_interface(node, "arm_msgs/msg/Joint", timeout_s=60.0)
        joint = message_class(found.name, found.catalogue)
        assert (found.told_by, joint is peer.catalogue, getattr(joint, "MANY", None)) == (
            "/arm",
            False,
            4 if sources else None,
        )
        got: list[Any] = []
        node.create_subscription(joint, "/joint", got.append, dedicated=True)
        bend = node.fetch_interface("arm_msgs/srv/Bend", timeout_s=60.0)
        nothing = node.fetch_interface("arm_msgs/srv/Nothing", timeout_s=60.0)
        reach = node.fetch_interface(ARM, timeout_s=60.0)
        wait = asyncio.run(node.fetch_interface_async("arm_msgs/action/Wait", timeout_s=60.0))
        for kind in (bend, reach, wait):
            assert kind.__metaros_hash__ == type_hash(kind.__metaros_name__, peer.catalogue)
            assert kind is not message_class(kind.__metaros_name__, peer.catalogue)
        assert (bend.Request().times, getattr(reach.Goal, "STRAIGHT", None)) == ((3, 1) if sources else (0, None))

        request = bend.Request(joint=joint(name="wrist"), times=3)
        answer = node.create_client(bend, "/bend").call(request, timeout_s=60.0)
        assert (answer.done, answer.header.frame_id) == (True, "wrist")
        assert node.create_client(nothing, "/nothing").call(nothing.Request(), timeout_s=60.0) == nothing.Response()

        fed: list[Any] = []
        with spinning(node):
            client = node.create_action_client(reach, "/reach")
            assert client.wait_for_server(60.0)
            goal = client.send_goal(reach.Goal(path=[joint(), joint(name="end")]), feedback=fed.append, timeout_s=60.0)
            accepted = goal.wait()
            wait_until(lambda: [message.now.name for message in fed] == ["end"])
            assert accepted.result(60.0).wait().result.error == 2.0
        wait_until(lambda: got)
        assert got[0].name == "elbow"

        asked = len(peer.asked)  # from now on it is known
        assert node.fetch_interface(ARM) is reach
        assert fetch_type(node, f"{ARM}_SendGoal", type_hash(f"{ARM}_SendGoal", peer.catalogue)) is not None
        assert node.fetch_interface("arm_msgs/srv/Bend") is bend
        assert len(peer.asked) == asked


def test_a_node_that_lies_is_named_and_another_one_is_asked(here, there, monkeypatch, caplog):
    def honest(peer: TypedPeer) -> None:
        peer.node.create_client(peer.type("arm_msgs/srv/Bend"), "/bend")
        peer.node.create_action_client(peer.type(ARM), "/reach")

    lies = ("arm_msgs/msg/Joint", "arm_msgs/srv/Bend", ARM)
    with (
        typed_peer(there, "liar", TEXTS, serve, monkeypatch, lie=OTHER) as liar,
        metaros.Node("asker", context=here) as node,
    ):
        for name in lies:
            with pytest.raises(UnknownTypeError) as caught:
                node.fetch_interface(name, timeout_s=60.0)
            assert "/liar: what the node says of " in str(caught.value)
            assert "does not lead to the hash" in str(caught.value)
        assert "/liar is not believed" in caplog.text
        wanted = type_hash(ARM, liar.catalogue)
        assert catalogue_of(ARM, wanted) is None
        with typed_peer(there, "honest", TEXTS, honest, monkeypatch):
            wait_until(lambda: node.graph.endpoints("/reach/_action/feedback", "MS"))
            for name in lies[1:]:
                found = find_interface(node, name, timeout_s=60.0)
                assert (found.told_by, type_hash(name, found.catalogue)) == (
                    "/honest",
                    type_hash(name, liar.catalogue),
                )


def test_one_goal_may_have_two_results(here, there, monkeypatch):
    """Two nodes mean different things by one action, whose goals have the same hash."""

    def end(peer: TypedPeer) -> None:
        peer.node.create_action_server(peer.type(ARM), "/reach", lambda goal: goal.succeed())

    texts = {**TEXTS, ARM: "Joint[] path\n---\nint8 error\n---\n"}
    with metaros.Node("asker", context=here) as node:
        with typed_peer(there, "first", TEXTS, end, monkeypatch):
            first = node.fetch_interface(ARM, timeout_s=60.0)
        wait_until(lambda: not node.graph.endpoints("/reach/_action/feedback"))
        remembered = dict_of_known()
        with typed_peer(there, "second", texts, end, monkeypatch) as peer:
            restore(remembered)
            wait_until(lambda: node.graph.endpoints("/reach/_action/feedback"))
            shared = type_hash(f"{ARM}_SendGoal", peer.catalogue)
            second = node.fetch_interface(ARM, shared, timeout_s=60.0)
    assert first.__metaros_hash__ != second.__metaros_hash__ == type_hash(ARM, peer.catalogue)
    assert isinstance(second.Result().error, int)


def dict_of_known() -> dict[Any, Catalogue]:
    """What this process was told so far."""
    from metaros.idl import known

    return dict(known._known)


def restore(remembered: dict[Any, Catalogue]) -> None:
    """And knows again."""
    from metaros.idl import known

    known._known.update(remembered)


def test_feedback_and_parts_of_services_are_messages_of_their_own(here, there, monkeypatch):
    with (
        typed_peer(there, "arm", TEXTS, serve, monkeypatch) as peer,
        metaros.Node("asker", context=here) as node,
    ):
        name = f"{ARM}_FeedbackMessage"
        wait_until(lambda: node.graph.endpoints("/reach/_action/feedback"))
        catalogue = fetch_type(node, name, type_hash(name, peer.catalogue), timeout_s=60.0)
        feedback = message_class(name, catalogue)()
        assert (feedback.feedback.now.name, peer.asked) == ("", [(name, type_hash(name, peer.catalogue))])


def test_a_type_that_nobody_uses_is_said_to_be_unknown(here):
    with metaros.Node("asker", context=here) as node:
        for name in ("no_msgs/msg/Where", "no_msgs/srv/Where", "no_msgs/action/Where"):
            with pytest.raises(UnknownTypeError, match=f"^{name} is not in the catalogue\nno node that uses it"):
                node.fetch_interface(name, timeout_s=0.01)
            with pytest.raises(UnknownTypeError, match="with the hash RIHS01_00"):
                node.fetch_interface(name, f"RIHS01_{'0' * 64}", timeout_s=0.01)


def test_types_of_endpoints_are_told_by_our_own_nodes(here, there, monkeypatch):
    """Each with the class of its endpoint, which stands in no catalogue of the process."""
    texts = {
        "own_msgs/msg/Ear": "int8 size 2\n",
        "own_msgs/srv/Hear": "Ear ear\n---\n",
        "own_msgs/action/Listen": "Ear ear\n---\n---\nint8 x\n",
    }
    catalogue = catalogue_with(texts)
    with metaros.Node("own", context=there) as own, metaros.Node("asker", context=here) as node, spinning(own):
        own.create_publisher(message_class("own_msgs/msg/Ear", catalogue), "/ear")
        own.create_service(message_class("own_msgs/srv/Hear", catalogue), "/hear", lambda request, response: None)
        own.create_action_server(message_class("own_msgs/action/Listen", catalogue), "/listen", lambda goal: None)
        from metaros.interfaces.type_description_interfaces.srv import GetTypeDescription

        client = node.create_client(GetTypeDescription, "/own/get_type_description")
        assert client.wait_for_service(60.0)
        for name in (*texts, *(f"own_msgs/action/Listen{part}" for part in ("_SendGoal", "_GetResult"))):
            request = GetTypeDescription.Request(
                type_name=name, type_hash=type_hash(name, catalogue), include_type_sources=True
            )
            response = client.call(request, timeout_s=60.0)
            assert (response.successful, response.type_description.type_description.type_name) == (True, name)
            sources = {source.type_name: source.encoding for source in response.type_sources}
            kind = name.split("/")[1]
            assert sources[name] == ("implicit" if "_" in name.rpartition("/")[2] else kind)
            assert sources.get("own_msgs/msg/Ear") == (None if name.endswith("_GetResult") else "msg")
