"""Nodes of ROS 2 Humble, which write no type hashes, beside ours and those of later releases, on one router."""

from __future__ import annotations

import queue
import struct
import threading
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest
import zenoh

import metaros
from metaros.cdr import codec
from metaros.errors import ConfigError, UnavailableError
from metaros.idl import message_class
from metaros.interfaces.std_msgs.msg import String
from metaros.interfaces.std_srvs.srv import SetBool
from metaros.wire import History, QoSProfile, parse_token, qos_transient_local
from metaros.wire.names import NO_HASH
from tests.metaros.node.action.test_actions import spinning
from tests.support.nodes.raw_peer import STAMP_NS, RawPeer, open_session
from tests.support.servers.routers import zenoh_router as started_router
from tests.support.waiting import wait_until

STRING, BOOL = "std_msgs::msg::dds_::String_", "std_srvs::srv::dds_::SetBool_"
VOLATILE, LATCHED = "::,10:,:,:,,", ":1:,1:,:,:,,"
ALL = QoSProfile(history=History.KEEP_ALL)
KEPT = replace(qos_transient_local, depth=1000)
CODE = codec(String)
REQUEST, RESPONSE = codec(SetBool.Request), codec(SetBool.Response)


@pytest.fixture(scope="module")
def router() -> Iterator[str]:
    """A router of this file's own: whoever sees a node of Humble goes on listening for more of them."""
    with started_router() as endpoint:
        yield endpoint


@pytest.fixture
def context(router: str) -> Iterator[metaros.Context]:
    """Ours."""
    with metaros.Context(connect=router) as made:
        yield made


@pytest.fixture
def other(router: str) -> Iterator[metaros.Context]:
    """Another program of ours."""
    with metaros.Context(connect=router) as made:
        yield made


@pytest.fixture
def humble(router: str) -> Iterator[RawPeer]:
    """A node of Humble, in Zenoh's terms alone."""
    with open_session(router) as session:
        yield RawPeer(session)


def said(arrived: Any) -> list[str]:
    """What a raw subscription has got so far."""
    found = []
    while True:
        try:
            found.append(CODE.decode(arrived.get_nowait().payload.to_bytes()).data)
        except queue.Empty:
            return found


def test_nothing_is_declared_without_such_a_peer(context: metaros.Context, other: metaros.Context) -> None:
    with metaros.Node("a", context=context) as node, metaros.Node("b", context=other) as peer:
        ends = [
            node.create_publisher(String, "/talk", qos_transient_local),
            node.create_subscription(String, "/talk", print),
            node.create_service(SetBool, "/set", lambda request, response: None),
        ]
        peer.create_subscription(String, "/talk", print)
        wait_until(lambda: ends[0].events.matched == 2)
        assert [end.twin.opened for end in ends] == [False] * 3
        assert list(context.session.zenoh.get(f"0/set/{BOOL}/{NO_HASH}", timeout=1.0)) == []


def test_each_message_is_heard_once_in_every_way_of_listening(
    context: metaros.Context, other: metaros.Context, humble: RawPeer
) -> None:
    """Ours is on both keys while somebody of Humble listens, which those of us who do hear both must not notice."""
    got: dict[str, list[str]] = {}

    def hear(name: str) -> Any:
        got[name] = []
        return lambda message: got[name].append(message.data)

    ways = {
        "executor": {},
        "dedicated": {"dedicated": True},
        "all": {"qos": ALL},
        "all dedicated": {"qos": ALL, "dedicated": True},
        "latched": {"qos": KEPT},
        "latched dedicated": {"qos": KEPT, "dedicated": True},
    }
    with metaros.Node("a", context=context) as node, metaros.Node("b", context=other) as peer, spinning(node):
        subscriptions = [
            node.create_subscription(String, "/talk", hear(name), options.pop("qos", 1000), **options)
            for name, options in ways.items()
        ]
        ours = peer.create_publisher(String, "/talk", KEPT)
        within = node.create_publisher(String, "/talk", KEPT)
        ear = humble.subscribe("/talk", STRING, NO_HASH, VOLATILE)
        latched = humble.publisher("/talk", STRING, NO_HASH, ":1:,10:,:,:,,")
        wait_until(lambda: all(one.events.matched == 3 for one in subscriptions))
        wait_until(lambda: all(one.twin.opened for one in subscriptions))
        wait_until(lambda: ours.twin.opened and within.twin.opened)
        # what is on its way to be heard: from here on everything is
        wait_until(lambda: (ours.publish(String(data="?")), "?" in said(ear))[1])
        wait_until(lambda: (latched(CODE.encode(String(data="!"))), all("!" in heard for heard in got.values()))[1])
        for number in range(20):
            ours.publish(String(data=f"ours {number}"))
            within.publish(String(data=f"within {number}"))
            latched(CODE.encode(String(data=f"humble {number}")))
        last = {"ours 19", "within 19", "humble 19"}
        wait_until(lambda: all(last <= set(heard) for heard in got.values()))
        wanted = sorted(f"{who} {number}" for who in ("ours", "within", "humble") for number in range(20))
        numbered = {name: sorted(word for word in heard if " " in word) for name, heard in got.items()}
        assert numbered == dict.fromkeys(got, wanted)
        heard = []
        wait_until(lambda: (heard.extend(said(ear)), last <= set(heard))[1])
        assert sorted(word for word in heard if " " in word) == wanted
        assert [one.mismatched for one in (*subscriptions, ours, within)] == [0] * 8
        assert [one.lost for one in subscriptions] == [0] * 6


def test_what_is_kept_is_told_to_who_comes_late(context: metaros.Context, humble: RawPeer) -> None:
    with metaros.Node("a", context=context) as node:
        publisher = node.create_publisher(String, "/map", qos_transient_local)
        for word in ("old", "newest"):
            publisher.publish(String(data=word))
        arrived = humble.subscribe("/map", STRING, NO_HASH, LATCHED)
        sample = arrived.get(timeout=60)
        assert CODE.decode(sample.payload.to_bytes()).data == "newest"
        assert struct.unpack_from("<q", sample.attachment.to_bytes()) == (2,)
        assert sample.attachment.to_bytes()[-16:] == publisher.gid
        publisher.publish(String(data="later"))
        assert CODE.decode(arrived.get(timeout=60).payload.to_bytes()).data == "later"
        publisher.close()


def test_a_publisher_stops_when_the_last_one_leaves(context: metaros.Context, humble: RawPeer, router: str) -> None:
    with metaros.Node("a", context=context) as node, open_session(router) as session:
        publisher = node.create_publisher(String, "/talk")
        with open_session(router) as gone:
            peer = RawPeer(gone)
            leaving = peer.subscribe("/talk", STRING, NO_HASH, VOLATILE)
            wait_until(lambda: (publisher.publish(String(data="x")), said(leaving))[1])
        silent: queue.SimpleQueue[Any] = queue.SimpleQueue()
        with session.declare_subscriber(f"0/talk/{STRING}/{NO_HASH}", silent.put):
            wait_until(lambda: publisher.events.matched == 0)
            both = session.declare_subscriber(publisher.key, zenoh.handlers.FifoChannel(1000))
            wait_until(lambda: (publisher.publish(String(data="y")), both.try_recv())[1])
            assert silent.empty()


def test_services_both_ways(context: metaros.Context, humble: RawPeer) -> None:
    def on_set(request: Any, response: Any) -> None:
        response.success = request.data

    def answer(query: zenoh.Query) -> None:
        payload = RESPONSE.encode(SetBool.Response(message="humble"))
        with query:
            query.reply(query.key_expr, payload, attachment=query.attachment)

    asked = REQUEST.encode(SetBool.Request(data=True))
    with metaros.Node("a", context=context) as node, spinning(node):
        service = node.create_service(SetBool, "/ours", on_set)
        client = humble.client("/ours", BOOL, NO_HASH)
        wait_until(lambda: service.twin.opened)
        wait_until(lambda: humble.session.declare_querier(client.key).matching_status.matching)
        assert RESPONSE.decode(client.ask(asked)).success is True

        mine = node.create_client(SetBool, "/theirs")
        with pytest.raises(UnavailableError):
            mine.call(SetBool.Request())
        humble.serve("/theirs", BOOL, NO_HASH, answer)
        assert mine.wait_for_service(60.0)
        assert mine.call(SetBool.Request(), timeout_s=60.0).message == "humble"
        other = node.create_service(SetBool, "/theirs", on_set)  # where there is one of our own kind it is asked
        wait_until(lambda: mine.node.graph.endpoints("/theirs", "SS")[1:])
        assert mine.call_future(SetBool.Request(data=True), timeout_s=60.0).result(60).success is True
        other.close()
        assert mine.call(SetBool.Request(), timeout_s=60.0).message == "humble"


def test_a_program_of_humble(router: str, context: metaros.Context, humble: RawPeer) -> None:
    """It writes no hashes, and speaks with both kinds."""
    heard: dict[str, list[str]] = {"own": [], "ours": []}
    with (
        metaros.Context(connect=router, environ={"METAROS_ROS_DISTRO": "humble"}) as old,
        metaros.Node("old", context=old) as node,
        metaros.Node("new", context=context) as new,
        spinning(node),
        spinning(new),
    ):
        wait_until(lambda: any("/MP/%/%/old/" in token for token in humble.tokens()))
        tokens = [parse_token(token) for token in humble.tokens() if "/%/%/old" in token]
        assert {token.type_hash for token in tokens if hasattr(token, "type_hash")} == {NO_HASH}
        node.create_subscription(String, "/talk", lambda message: heard["own"].append(message.data))
        new.create_subscription(String, "/talk", lambda message: heard["ours"].append(message.data))
        mine, ours = node.create_publisher(String, "/talk"), new.create_publisher(String, "/talk")
        theirs, ear = (
            humble.publisher("/talk", STRING, NO_HASH, VOLATILE),
            humble.subscribe("/talk", STRING, NO_HASH, VOLATILE),
        )
        got: list[str] = []

        def all_heard() -> bool:
            mine.publish(String(data="mine"))
            ours.publish(String(data="ours"))
            theirs(CODE.encode(String(data="theirs")))
            got.extend(said(ear))
            return {"mine", "ours"} <= set(got) and all(
                {"mine", "ours", "theirs"} <= set(words) for words in heard.values()
            )

        wait_until(all_heard)
        assert (mine.mismatched, ours.mismatched) == (0, 0)
        node.create_service(SetBool, "/set", lambda request, response: setattr(response, "success", True))
        client = new.create_client(SetBool, "/set")
        assert client.wait_for_service(60.0)
        assert client.call(SetBool.Request(), timeout_s=60.0).success is True
        new.create_service(SetBool, "/set2", lambda request, response: setattr(response, "success", True))
        client = node.create_client(SetBool, "/set2")
        assert client.wait_for_service(60.0)
        assert client.call(SetBool.Request(), timeout_s=60.0).success is True


def test_actions_of_humble(router: str, context: metaros.Context) -> None:
    fibonacci = message_class("example_interfaces/action/Fibonacci")

    def execute(goal: Any) -> Any:
        goal.publish_feedback(fibonacci.Feedback(sequence=[goal.request.order]))
        goal.succeed()
        return fibonacci.Result(sequence=[1, 2])

    def run(where: metaros.Context, there: metaros.Context) -> None:
        fed: list[int] = []
        with (
            metaros.Node("server", context=where) as server,
            metaros.Node("client", context=there) as node,
            spinning(server),
            spinning(node),
        ):
            server.create_action_server(fibonacci, "/count", execute)
            client = node.create_action_client(fibonacci, "/count")
            assert client.wait_for_server(60.0)
            options: Any = {"feedback": lambda message: fed.append(int(message.sequence[0])), "timeout_s": 60.0}
            goal = client.send_goal(fibonacci.Goal(order=7), **options).wait()
            wait_until(lambda: fed == [7])
            assert list(goal.result(60.0).wait().result.sequence) == [1, 2]
        wait_until(lambda: not there.graph.endpoints("/count/_action/send_goal"))

    with metaros.Context(connect=router, ros_distro="humble") as old:
        run(old, context)
        run(context, old)


def test_later_and_older_releases_are_read(context: metaros.Context, humble: RawPeer) -> None:
    """The 14th part of a token, and the attachment of 77 bytes that was written until mid-2025."""
    got: list[str] = []
    with metaros.Node("a", context=context) as node:
        subscription = node.create_subscription(String, "/talk", lambda one: got.append(one.data), dedicated=True)
        for number, hash_text in enumerate((String.__metaros_hash__, NO_HASH)):
            token = humble.token("MP", "/talk", STRING, hash_text, VOLATILE)
            gid = humble.announce(f"{token}/backends:cpu:" if not number else token)
            names = (b"sequence_number", 1), (b"source_timestamp", STAMP_NS), (b"source_gid", gid)
            attachment = b"".join(
                bytes([len(name)]) + name + (struct.pack("<q", value) if isinstance(value, int) else b"\x10" + value)
                for name, value in names
            )
            assert len(attachment) == 77
            wait_until(lambda number=number: subscription.events.matched == number + 1)
            payload = CODE.encode(String(data=hash_text[:4]))

            def heard(hash_text: str = hash_text, payload: bytes = payload, attachment: bytes = attachment) -> bool:
                humble.session.put(f"0/talk/{STRING}/{hash_text}", payload, attachment=attachment)
                return hash_text[:4] in got

            wait_until(heard)
        assert (subscription.malformed, subscription.mismatched) == (0, 0)


def test_a_word_that_is_no_distribution() -> None:
    with pytest.raises(ConfigError, match="METAROS_ROS_DISTRO: 'hydro' is none of humble, jazzy"):
        metaros.Context(environ={"METAROS_ROS_DISTRO": "hydro"})
    with pytest.raises(ConfigError, match="ros_distro: 'foxy'"):
        metaros.Context(ros_distro="foxy")


def test_no_thread_is_left() -> None:
    """Of the lanes of the second key."""
    wait_until(lambda: not [one.name for one in threading.enumerate() if one.name.startswith("metaros/talk")])
