"""The channels and services that were advertised to a client, by number, and what changed since. Pure.

A number is never given to anything else on a connection. Where two robots' names become one, or one topic has two
types, the first stays: viewers take one channel a topic.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Set
from dataclasses import dataclass, field
from typing import Any

from gateway.api.foxglove.texts import ServiceView, channel_view
from gateway.domain.channel import Channel
from metaros.errors import MetarosError
from metaros.idl import default_catalogue, schema_text, type_hash

__all__ = ["Changes", "Directory", "Offered", "channel_facts"]

SEALED = "sealed/"  # a channel's encoding begins so where its payloads are encrypted
NEEDS_SCHEMA = ("cdr", "ros1", "protobuf", "flatbuffer")


@dataclass(frozen=True, slots=True)
class Offered:
    """A channel as the client knows it."""

    number: int
    topic: str
    channel: Channel


@dataclass(frozen=True, slots=True)
class Changes:
    """What is new and what is gone; `unreadable` and `left_out` count what is not shown at all."""

    new: list[Offered]
    gone: list[int]
    unreadable: int = 0
    left_out: int = 0


@dataclass(slots=True)
class Directory:
    """At most `most` channels."""

    most: int
    channels: dict[int, Offered] = field(default_factory=dict)
    services: dict[int, ServiceView] = field(default_factory=dict)
    _by_topic: dict[str, int] = field(default_factory=dict)
    _by_service: dict[str, int] = field(default_factory=dict)
    _unreadable: Counter[str] = field(default_factory=Counter)  # by robot
    _left_out: Counter[str] = field(default_factory=Counter)
    _last: int = 0

    def update_channels(self, found: Iterable[tuple[str, Channel]], *, robots: Set[str] | None = None) -> Changes:
        """These are there now, by the names that the client sees; with `robots` all of those, and no others changed."""
        known = {
            topic: item
            for topic, number in self._by_topic.items()
            if (item := self.channels[number]) and (robots is None or item.channel.robot in robots)
        }
        for counts in (self._unreadable, self._left_out):
            for robot in list(counts) if robots is None else robots:
                counts.pop(robot, None)
        wanted: dict[str, Channel] = {}
        room = self.most - len(self._by_topic) + len(known)
        for topic, channel in found:
            if topic in wanted:
                continue
            if not _readable(channel):
                self._unreadable[channel.robot] += 1
            elif len(wanted) >= room:
                self._left_out[channel.robot] += 1
            else:
                wanted[topic] = channel
        gone = [
            item.number
            for topic, item in known.items()
            if topic not in wanted or wanted[topic].identity != item.channel.identity
        ]
        for number in gone:
            del self._by_topic[self.channels.pop(number).topic]
        new = [self._add(topic, channel) for topic, channel in wanted.items() if topic not in self._by_topic]
        return Changes(new, gone, self._unreadable.total(), self._left_out.total())

    def update_services(self, found: Iterable[tuple[str, str, str, str]]) -> tuple[list[ServiceView], list[int]]:
        """(name, type, request's schema, response's) that are there now; returns the new ones and who is gone."""
        wanted: dict[str, tuple[str, str, str]] = {}
        for name, *rest in found:
            if len(wanted) < self.most:
                wanted.setdefault(name, (rest[0], rest[1], rest[2]))
        gone = [number for name, number in self._by_service.items() if self._as_found(number) != wanted.get(name)]
        for number in gone:
            del self._by_service[self.services.pop(number).name]
        new = []
        for name, (type_name, request, response) in wanted.items():
            if name not in self._by_service:
                self._last += 1
                view = self.services[self._last] = ServiceView(self._last, name, type_name, request, response)
                self._by_service[name] = view.id
                new.append(view)
        return new, gone

    def _as_found(self, number: int) -> tuple[str, str, str]:
        view = self.services[number]
        return view.type_name, view.request, view.response

    def _add(self, topic: str, channel: Channel) -> Offered:
        self._last += 1
        made = self.channels[self._last] = Offered(self._last, topic, channel)
        self._by_topic[topic] = made.number
        return made


def channel_facts(offered: Offered) -> dict[str, Any]:
    """A channel as it is advertised: the schema is what its robot announced, text for text."""
    channel = offered.channel
    schema_encoding, schema = _schema(channel)
    return channel_view(
        offered.number,
        topic=offered.topic,
        encoding=channel.encoding,
        schema_name=channel.schema_name,
        schema_encoding=schema_encoding,
        schema=schema,
        metadata={"robot": channel.robot},
    )


def _readable(channel: Channel) -> bool:
    if channel.encoding.startswith(SEALED):
        return False
    return channel.encoding not in NEEDS_SCHEMA or bool(_schema(channel)[1])


def _schema(channel: Channel) -> tuple[str, str]:
    """(encoding, text) of a channel's schema; the shipped one where the robot sent none and means the same type."""
    if channel.schema:
        return channel.schema_encoding or "ros2msg", channel.schema.decode("utf-8", "replace")
    name, shipped = channel.schema_name, default_catalogue()
    try:
        if name in shipped and channel.type_hash in ("", type_hash(name, shipped)):
            return "ros2msg", schema_text(name, shipped)
    except MetarosError:
        return "", ""
    return "", ""
