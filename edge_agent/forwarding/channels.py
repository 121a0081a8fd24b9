"""The channels and series of a robot: what the tap saw, numbered, described for the gateway, and counted.

A live channel whose row has a `history_hz` has a second one beside it, its `copy`: bulk, at that rate, whether anybody
watches or not. It is for the gateway's store alone; here and there people see one topic.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

from edge_agent.config.topic_table import Delivery, TopicRule, TopicTable, series_name
from edge_agent.forwarding.channel import CLASS_NUMBERS, Channel
from edge_agent.forwarding.filters import MetricExtractor, SampleDeadband
from edge_agent.outbox import ChannelId, IdLog, SeriesId
from metaros._proto import link_pb2
from metaros.cdr import field_reader
from metaros.errors import FieldError, UsageError
from metaros.idl import Catalogue, catalogue_of, schema_text
from metaros.limits import LIMITS, Limits

__all__ = ["METRIC_STREAM", "Channel", "Channels"]

METRIC_STREAM = 0
ANNOUNCE_BYTES = 1 << 20
HISTORY = "history"  # the class of a copy in the file of numbers
Name = tuple[str, str, str]  # topic, type, hash


class Channels:
    """The registry: channel ids and series ids come from the outbox's file of them, and mean one thing for ever."""

    def __init__(self, table: TopicTable, ids: IdLog, *, namespace: str, limits: Limits = LIMITS) -> None:
        self._table = table
        self._ids = ids
        self._namespace = namespace
        self._limits = limits
        self._by_name: dict[Name, Channel] = {}
        self._copies: dict[Name, Channel] = {}
        self._by_id: dict[int, Channel] = {}
        self._series: list[tuple[int, link_pb2.Series]] = []
        self.revision = 0
        self.watched = False  # somebody wants samples of a topic now
        self.on_watched: Callable[[], None] = lambda: None  # called when that begins
        self.refused = 0
        for known in list(ids.channels.values()):
            self._recall(known)
        for series in ids.series.values():
            self._series.append((self.revision + 1, link_pb2.Series(series_id=series.series, **series_texts(series))))
        self.revision += 1

    def __iter__(self) -> Iterator[Channel]:
        """The topics' channels, without their copies."""
        return (channel for channel in self._by_id.values() if not channel.history)

    def __len__(self) -> int:
        return len(self._by_id)

    def observe(self, topic: str, type_name: str, hash_text: str, *, qos: str, keeps_all: bool) -> Channel | None:
        """The channel of a topic and type, new or known; None when the table of channels is full.

        A publisher that is reliable and keeps all (`keeps_all`) lifts an `auto` row to bulk, even later: the topic then
        has another channel, so that no number of a live sample is ever taken for one of a durable stream.
        """
        channel = self._by_name.get((topic, type_name, hash_text))
        if channel is None:
            if len(self._by_id) >= self._limits.channels_per_robot:
                self.refused += 1
                return None
            channel = self._create(topic, type_name, hash_text, keeps_all=keeps_all)
        channel.keeps_all |= keeps_all
        if keeps_all and channel.rule.delivery == "auto" and channel.delivery == "live":
            channel = self._replace(channel) or channel
        if qos and qos != channel.qos:
            for each in (channel, channel.copy):
                if each is not None:
                    each.qos = qos
                    self._changed(each)
        return channel

    def learn(self, channel: Channel, catalogue: Catalogue) -> None:
        """A channel's type became known: it has a schema and perhaps series from now on."""
        schema = schema_text(channel.type_name, catalogue).encode()
        if len(schema) > self._limits.schema_bytes:
            return
        for each in (channel, channel.copy):
            if each is not None:
                each.schema, each.catalogue = schema, catalogue
                self._ids.describe(replace(self._ids.channels[each.channel_id], schema=schema.decode()))
                self._read_fields(each, catalogue)
                self._changed(each)

    def by_id(self, channel_id: int) -> Channel | None:
        """The channel of that id."""
        return self._by_id.get(channel_id)

    def demand(self, entries: Mapping[int, float]) -> None:
        """Give every channel its share of a Demand; empty = nobody watches."""
        for channel in self._by_id.values():
            watched = channel.channel_id in entries
            if channel.deadband is not None and watched and channel.selector.demand_hz is None:
                channel.deadband.reset()  # who begins to watch sees where things stand
            channel.selector.demand(entries.get(channel.channel_id))
        self.watched = bool(entries)
        if self.watched:
            self.on_watched()

    def announcements(self, after: int) -> Iterator[link_pb2.Announce]:
        """What is new or changed since revision `after`, in frames of bounded size."""
        announce, size = link_pb2.Announce(), 0
        for channel in self._by_id.values():
            if channel.revision > after:
                if size + len(channel.schema) > ANNOUNCE_BYTES:
                    yield announce
                    announce, size = link_pb2.Announce(), 0
                announce.channels.append(channel.describe())
                size += len(channel.schema) + 512
        announce.series.extend(series for revision, series in self._series if revision > after)
        if announce.channels or announce.series:
            yield announce

    def _create(self, topic: str, type_name: str, hash_text: str, *, keeps_all: bool) -> Channel:
        rule = self._table.rule(topic)
        delivery, max_rate_hz = decide(rule, keeps_all=keeps_all)
        known = catalogue_of(type_name, hash_text) if hash_text.startswith("RIHS01_") else None
        number = self._ids.channel(
            topic=topic, type_name=type_name, type_hash=hash_text, delivery=delivery, sealed=rule.sealed
        )
        channel = Channel(
            channel_id=number,
            topic=topic,
            type_name=type_name,
            type_hash=hash_text,
            rule=rule,
            delivery=delivery,
            max_rate_hz=max_rate_hz,
            metrics=None,
            schema=schema_text(type_name, known).encode() if known else b"",
            sealed=rule.sealed,
            keeps_all=keeps_all,
            catalogue=known,
        )
        self._by_name[topic, type_name, hash_text] = self._by_id[channel.channel_id] = channel
        if known:
            self._read_fields(channel, known)
        if delivery == "live" and rule.history_hz > 0 and rule.forward:
            channel.copy = self._copy(channel, known)
        self._changed(channel)
        return channel

    def _copy(self, live: Channel, catalogue: Catalogue | None) -> Channel | None:
        """The history channel of a live one: that of an earlier run, or a new one; None when the table is full."""
        name = (live.topic, live.type_name, live.type_hash)
        if (known := self._copies.get(name)) is not None:
            known.qos = live.qos
            if known.rule != (rule := copy_rule(live.rule)):
                self._adapt(known, rule, rule.max_rate_hz)
            return known
        if len(self._by_id) >= self._limits.channels_per_robot:
            self.refused += 1
            return None
        topic, type_name, type_hash = name
        number = self._ids.channel(
            topic=topic, type_name=type_name, type_hash=type_hash, delivery=HISTORY, sealed=live.sealed
        )
        return self._add_copy(self._ids.channels[number], live.rule, live.schema, catalogue)

    def _add_copy(self, known: ChannelId, rule: TopicRule, schema: bytes, catalogue: Catalogue | None) -> Channel:
        """A history channel with that number."""
        rule = copy_rule(rule)
        copy = Channel(
            channel_id=known.channel,
            topic=known.topic,
            type_name=known.type_name,
            type_hash=known.type_hash,
            rule=rule,
            delivery="bulk",
            max_rate_hz=rule.max_rate_hz,
            metrics=None,
            schema=schema,
            history=True,
            sealed=known.sealed,
            catalogue=catalogue,
        )
        self._by_id[copy.channel_id] = copy
        if known.sealed == rule.sealed:  # else it only says what waits of an earlier run
            self._copies[known.topic, known.type_name, known.type_hash] = copy
        if catalogue:
            self._read_fields(copy, catalogue)
        self._changed(copy)
        return copy

    def use(self, table: TopicTable) -> list[str]:
        """Another table from now on; the topics that stay in their class, because the table of channels is full.

        A topic of another class, or sealed from now on, has another channel, as `observe` would give it: samples on
        their way keep the one that they were taken for.
        """
        self._table, kept = table, []
        for channel in list(self._by_name.values()):
            rule = table.rule(channel.topic)
            delivery, max_rate_hz = decide(rule, keeps_all=channel.keeps_all)
            if rule == channel.rule and delivery == channel.delivery:
                continue
            if (delivery, rule.sealed) == (channel.delivery, channel.sealed):
                self._adapt(channel, rule, max_rate_hz)
            elif self._replace(channel) is None:
                kept.append(channel.topic)
        return kept

    def _adapt(self, channel: Channel, rule: TopicRule, max_rate_hz: float) -> None:
        """Another row for a channel that stays what it is."""
        wanted_hz = channel.selector.wanted_hz
        channel.use(rule, max_rate_hz)
        channel.selector.demand(wanted_hz)
        channel.metrics = channel.deadband = None
        if channel.catalogue is not None:
            self._read_fields(channel, channel.catalogue)
        if not channel.history:
            wants_copy = channel.delivery == "live" and rule.history_hz > 0 and rule.forward
            channel.copy = self._copy(channel, channel.catalogue) if wants_copy else None
        self._changed(channel)

    def _replace(self, channel: Channel) -> Channel | None:
        """The channel of a topic whose class is another from now on; None when the table of channels is full."""
        if len(self._by_id) >= self._limits.channels_per_robot:
            self.refused += 1
            return None
        other = self._create(channel.topic, channel.type_name, channel.type_hash, keeps_all=channel.keeps_all)
        other.schema, other.qos = channel.schema, channel.qos
        other.messages, other.size_bytes, other.dropped = channel.messages, channel.size_bytes, channel.dropped
        other.publishers, other.subscribers = channel.publishers, channel.subscribers
        if other.catalogue is None and channel.catalogue is not None:
            other.catalogue = channel.catalogue
            self._read_fields(other, channel.catalogue)
        if channel.schema:
            self._ids.describe(replace(self._ids.channels[other.channel_id], schema=channel.schema.decode()))
        return other

    def _recall(self, known: ChannelId) -> None:
        """A channel of an earlier run, of which samples are held: it is announced, and used again when it is seen."""
        rule = self._table.rule(known.topic)
        delivery, max_rate_hz = decide(rule, keeps_all=known.delivery == "bulk")
        catalogue = catalogue_of(known.type_name, known.type_hash)
        schema = known.schema.encode() or (schema_text(known.type_name, catalogue).encode() if catalogue else b"")
        if known.delivery == HISTORY:
            self._add_copy(known, rule, schema, catalogue)
            return
        same = (delivery, rule.sealed) == (known.delivery, known.sealed)
        channel = Channel(
            channel_id=known.channel,
            topic=known.topic,
            type_name=known.type_name,
            type_hash=known.type_hash,
            rule=rule,
            delivery=as_delivery(known.delivery),
            max_rate_hz=max_rate_hz,
            metrics=None,
            schema=schema,
            sealed=known.sealed,
            keeps_all=known.delivery == "bulk" and rule.delivery == "auto",
            catalogue=catalogue,
        )
        self._by_id[channel.channel_id] = channel
        if same and catalogue:
            self._read_fields(channel, catalogue)
        if same:
            self._by_name[known.topic, known.type_name, known.type_hash] = channel
        self._changed(channel)

    def _read_fields(self, channel: Channel, catalogue: Catalogue) -> None:
        """Those of the row's fields that the type has are read from now on: as series, and for the dead-band."""
        rule, type_name = channel.rule, channel.type_name
        fields = [path for path in rule.fields if has_field(type_name, path, catalogue)]
        if not channel.history and rule.seal != "sealed":
            channel.metrics = self._extractor(channel.topic, type_name, rule, fields, catalogue)
        if rule.deadband > 0 and fields:
            reader = field_reader(type_name, fields, catalogue)
            channel.deadband = SampleDeadband(reader, rule.deadband, max_s=rule.deadband_max_s)

    def _extractor(
        self, topic: str, type_name: str, rule: TopicRule, fields: list[str], catalogue: Catalogue
    ) -> MetricExtractor | None:
        """A reader of these fields as series: of those that are known, and of as many others as there may be."""
        ids: dict[str, int] = {}
        known = {series.series_id for _, series in self._series}
        for path in fields:
            name = series_name(topic, path, namespace=self._namespace)
            if name not in self._ids.series and len(self._series) >= self._limits.series_per_robot:
                continue
            number = ids[path] = self._ids.series_number(name=name, topic=topic, field=path)
            if number not in known:
                series = link_pb2.Series(series_id=number, name=name, topic=topic, field=path)
                self._series.append((self.revision + 1, series))
        if not ids:
            return None
        return MetricExtractor(
            tuple(ids.values()),
            field_reader(type_name, list(ids), catalogue),
            rate_hz=rule.metrics_rate_hz,
            deadband=rule.deadband,
            deadband_max_s=rule.deadband_max_s,
        )

    def _changed(self, channel: Channel) -> None:
        self.revision += 1
        channel.revision = self.revision


def copy_rule(rule: TopicRule) -> TopicRule:
    """The row of a live topic's history channel."""
    return replace(rule, delivery="bulk", max_rate_hz=rule.history_hz, history_hz=0.0, latest_only=False)


def as_delivery(text: str) -> Delivery:
    """A class that was read from a file."""
    return next((known for known in CLASS_NUMBERS if known == text), "bulk")


def series_texts(series: SeriesId) -> dict[str, str]:
    """A series' texts."""
    return {"name": series.name, "topic": series.topic, "field": series.field}


def decide(rule: TopicRule, *, keeps_all: bool) -> tuple[Delivery, float]:
    """A row's class and rate limit for a publisher."""
    if rule.delivery != "auto":
        return rule.delivery, rule.max_rate_hz
    return ("bulk", 0.0) if keeps_all else ("live", rule.max_rate_hz)


def has_field(type_name: str, path: str, catalogue: Catalogue | None = None) -> bool:
    """Whether the type has a numeric field of that path; the default table names topics, not types."""
    try:
        field_reader(type_name, [path], catalogue)
    except (FieldError, UsageError):
        return False
    return True
