"""How subscriptions of one client to one topic become one, and what is shared between clients."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest

from gateway.api.robot_access import ResolvedName
from gateway.api.rosbridge.encodings import encoding_of, json_view
from gateway.api.rosbridge.requests import Shape, Subscribe
from gateway.api.rosbridge.subscriptions import CountedSubscription, Subscriptions, merged
from gateway.api.ws.writer import split_frames
from gateway.domain.channel import Channel
from gateway.domain.client_names import ClientNames
from gateway.domain.records import Record
from gateway.errors import InvalidRequestError, TooManyError, UnknownRobotError
from gateway.live.encoding import Block
from gateway.live.subscription import TopicSubscription
from metaros.cdr import codec
from metaros.idl import schema_text, type_hash
from metaros.interfaces.std_msgs.msg import String

STRING = "std_msgs/msg/String"


def channel(topic: str = "/chat", *, robot: str = "r1", kind: str = STRING, encoding: str = "cdr") -> Channel:
    text, hash_text = schema_text(STRING).encode(), type_hash(STRING)
    return Channel(
        robot=robot,
        channel_id=1,
        topic=topic,
        schema_name=kind,
        type_hash=hash_text,
        encoding=encoding,
        schema_encoding="ros2msg",
        schema=text,
    )


def block(*words: str, of: Channel | None = None) -> Block:
    payloads = [codec(STRING).encode(String(data=word)) for word in words]
    return Block(of or channel(), [Record(seq, 10 + seq, 20, data) for seq, data in enumerate(payloads, 1)])


class Board:
    """A viewer that notes what it is subscribed to, and a client that sees r1 with a few topics."""

    def __init__(self, *channels: Channel, robot: str | None = "r1") -> None:
        self.names = ClientNames(robot, sees=lambda name: name == "r1")
        self.channels = channels
        self.running: dict[int, TopicSubscription] = {}
        self.warnings: list[str] = []

    def find_topic(self, name: str) -> tuple[ResolvedName, Channel | None]:
        candidates = [ResolvedName(*found) for found in self.names.candidates(name)]
        if not candidates:
            raise UnknownRobotError.of(name)
        for resolved in candidates:
            for item in self.channels:
                if (item.robot, item.topic) == (resolved.robot, resolved.name):
                    return resolved, item
        return candidates[0], None

    def subscribe(self, subscription: TopicSubscription) -> None:
        self.running[subscription.number] = subscription

    def unsubscribe(self, number: int) -> None:
        del self.running[number]

    def made(self) -> Subscriptions:
        found: Any = self
        return Subscriptions(found, found, lambda text, about: self.warnings.append(text))

    @property
    def only(self) -> TopicSubscription:
        (found,) = self.running.values()
        return found


def wanting(name: str | None = None, topic: str = "/chat", kind: str = "", **shape: Any) -> Subscribe:
    throttle_s, length = shape.pop("throttle_s", 0.0), shape.pop("length", 0)
    return Subscribe(
        op="subscribe",
        id=name,
        topic=topic,
        type_name=kind,
        throttle_s=throttle_s,
        queue_length=length,
        shape=Shape(**shape),
    )


def test_the_least_of_each_wins_and_the_later_compression() -> None:
    several = [
        wanting("a", throttle_s=0.5, length=9, fragment_size=500, compression="png"),
        wanting("b", throttle_s=0.2, length=3),
        wanting("c", throttle_s=0.9, length=5, fragment_size=300, compression="cbor"),
    ]
    assert merged(several) == (0.2, 3, Shape(fragment_size=300, compression="cbor"))
    assert merged(several[:2])[2] == Shape(fragment_size=500, compression="png")
    several.append(wanting("d", compression="cbor-raw"))
    assert merged(several) == (0.0, 0, Shape(fragment_size=300, compression="cbor-raw"))


def test_a_topic_runs_once_and_changes_with_its_subscriptions() -> None:
    board = Board(channel())
    made = board.made()
    made.subscribe(wanting("a", throttle_s=0.5))
    first = board.only
    assert (first.latest, first.max_rate_hz) == (True, 2.0)
    made.subscribe(wanting("b", throttle_s=0.5))
    assert board.only is first
    made.subscribe(wanting("c", length=4))
    assert isinstance(board.only, TopicSubscription)
    assert (board.only.latest, board.only.max_rate_hz) == (False, 0.0)  # b has no queue, c no throttle
    made.unsubscribe("/chat", "c")
    assert board.only.max_rate_hz == 2.0
    made.unsubscribe("/chat", None)
    assert not board.running
    for name in ("a", None):
        with pytest.raises(InvalidRequestError):
            made.unsubscribe("/chat", name)


def test_a_queue_holds_as_many_messages_as_was_said() -> None:
    counted = CountedSubscription(1, lambda _: True, lambda _: encoding_of("/chat", Shape()), length=3)
    encoding = encoding_of("/chat", Shape())
    grown = counted.hold(block("a", "b"), encoding) + counted.hold(block("c", "d"), encoding)
    assert (counted.dropped, grown) == (1, counted.size_bytes)
    first, second = counted.take(), counted.take()
    assert first is not None
    assert second is not None
    assert received([*split_frames(encoding.encode(first[0])), *split_frames(encoding.encode(second[0]))]) == [
        "b",
        "c",
        "d",
    ]


def received(frames: Sequence[tuple[int, bytes]]) -> list[str]:
    """The texts that frames carry."""
    return [json.loads(data)["msg"]["data"] for _, data in frames]


def test_what_is_wanted_is_the_topic_of_a_seen_robot_and_of_the_type() -> None:
    board = Board(channel(), robot=None)
    made = board.made()
    made.subscribe(wanting(topic="r1/chat", kind="std_msgs/String"))
    wants = board.only.wants
    assert wants(channel())
    assert not wants(channel("/other"))
    assert not wants(channel(robot="r2"))
    assert not wants(replace(channel(), history=True))  # a copy for the store
    assert not wants(channel(kind="std_msgs/msg/Int32"))
    for topic in ("/r2/chat", "/chat"):
        with pytest.raises(UnknownRobotError):
            made.subscribe(wanting(topic=topic))
    with pytest.raises(InvalidRequestError, match=f"has type {STRING}"):
        made.subscribe(wanting(topic="/r1/chat", kind="std_msgs/Int32"))


def test_of_two_topics_with_one_name_the_likelier_one() -> None:
    own, plain = channel("/r1/chat"), channel("/chat")
    board = Board(own, plain, robot=None)
    board.made().subscribe(wanting(topic="/r1/chat"))
    assert board.only.wants(own)
    assert not board.only.wants(plain)
    early = Board(robot=None)
    early.made().subscribe(wanting(topic="/r1/chat"))
    assert early.only.wants(plain)  # nothing is announced yet: either may be meant


def test_a_sealed_topic_is_not_shown_and_the_client_hears_why() -> None:
    board, sealed = Board(), channel(encoding="sealed/cdr")
    made = board.made()
    made.subscribe(wanting())
    assert not board.only.wants(sealed)
    assert "sealed" in board.warnings[0]
    made.subscribe(wanting("raw", compression="cbor-raw"))
    assert board.only.wants(sealed)


def test_subscriptions_are_bounded() -> None:
    made = Board().made()
    for number in range(256):
        made.subscribe(wanting(str(number)))
    with pytest.raises(TooManyError):
        made.subscribe(wanting("one more"))
    made.subscribe(wanting("255", throttle_s=1.0))  # another one under the same id


def test_clients_who_want_the_same_share_its_bytes_and_a_sample_is_decoded_once() -> None:
    assert encoding_of("/chat", Shape()) == encoding_of("/chat", Shape())
    assert encoding_of("/chat", Shape()) != encoding_of("chat", Shape())
    assert encoding_of("/chat", Shape(compression="png")) == encoding_of("/chat", Shape(compression="png"))
    samples = block("x", "y")
    shared = samples.encoded(encoding_of("/chat", Shape()))
    assert samples.encoded(encoding_of("/chat", Shape())) is shared
    made = samples.views(json_view)
    assert json.loads(samples.encoded(encoding_of("chat", Shape()))[2:].split(b"\x81")[0])["topic"] == "chat"
    assert all(one is other for one, other in zip(made, samples.views(json_view), strict=True))


def test_a_sample_that_is_none_of_its_type_is_left_out() -> None:
    samples = block("x", "y")
    bad = Block(samples.channel, [samples.records[0], Record(9, 9, 9, b"\0\1\0\0\xff"), samples.records[1]])
    for shape in (Shape(), Shape(fragment_size=20), Shape(compression="cbor"), Shape(compression="png")):
        assert bad.encoded(encoding_of("/c", shape)) == samples.encoded(encoding_of("/c", shape)) or shape.fragment_size
    assert len(list(split_frames(bad.encoded(encoding_of("/c", Shape()))))) == 2
