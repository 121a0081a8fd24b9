"""gRPC's side of the clients: channels, what is asked of the streams, what their replies and errors mean. Pure but for
the making of channels."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import grpc
import grpc.aio

from metaros._proto import events_pb2, telemetry_pb2
from metaros.cdr import codec
from metaros.client.access import Access
from metaros.client.results import Event, GoalUpdate, Sample, Values
from metaros.errors import MetarosError, RefusedError, TimeoutError_, UnavailableError
from metaros.idl import Catalogue, add_schema_text, default_catalogue, type_hash

__all__ = [
    "EventPosition",
    "Samples",
    "aio_channel",
    "channel",
    "goal_request",
    "goal_update",
    "patterns",
    "query_request",
    "refusal",
    "subscribe_request",
]

OPTIONS = (
    ("grpc.max_receive_message_length", -1),
    ("grpc.keepalive_time_ms", 20_000),
    ("grpc.initial_reconnect_backoff_ms", 200),
    ("grpc.max_reconnect_backoff_ms", 5_000),  # by itself it waits up to two minutes for a gateway that is there again
    ("grpc.enable_http_proxy", 0),
    ("grpc.enable_retries", 0),  # we do it; a call that it begins again by itself as a gateway ends may hang for ever
)
HTTP_STATUS = {
    grpc.StatusCode.INVALID_ARGUMENT: 400,
    grpc.StatusCode.UNAUTHENTICATED: 401,
    grpc.StatusCode.PERMISSION_DENIED: 403,
    grpc.StatusCode.NOT_FOUND: 404,
    grpc.StatusCode.ALREADY_EXISTS: 409,
    grpc.StatusCode.FAILED_PRECONDITION: 409,
    grpc.StatusCode.ABORTED: 409,
    grpc.StatusCode.RESOURCE_EXHAUSTED: 429,
    grpc.StatusCode.INTERNAL: 500,
    grpc.StatusCode.UNIMPLEMENTED: 501,
    grpc.StatusCode.UNAVAILABLE: 503,
    grpc.StatusCode.DEADLINE_EXCEEDED: 504,
}
Names = str | Sequence[str]


def channel(access: Access, target: str) -> grpc.Channel:
    """A channel that blocks."""
    if not access.tls:
        return grpc.insecure_channel(target, OPTIONS)
    return grpc.secure_channel(target, grpc.ssl_channel_credentials(access.roots_pem()), OPTIONS)


def aio_channel(access: Access, target: str) -> grpc.aio.Channel:
    """A channel of the running event loop."""
    if not access.tls:
        return grpc.aio.insecure_channel(target, OPTIONS)
    return grpc.aio.secure_channel(target, grpc.ssl_channel_credentials(access.roots_pem()), OPTIONS)


def patterns(names: Names | None) -> list[str]:
    """One or several; None: none."""
    return [names] if isinstance(names, str) else list(names or ())


def subscribe_request(
    topics: Names | None, series: Names | None, robots: Names | None, *, rate_hz: float, latest: bool, queue_bytes: int
) -> telemetry_pb2.SubscribeRequest:
    """What Subscribe is asked; samples come as CDR, and are decoded here."""
    return telemetry_pb2.SubscribeRequest(
        topics=patterns(topics),
        series=patterns(series),
        robots=patterns(robots),
        max_rate_hz=rate_hz,
        latest=latest,
        queue_bytes=queue_bytes,
    )


def query_request(
    robot: str, topics: Names | None, start: str, end: str, *, limit: int, newest_first: bool
) -> telemetry_pb2.QueryRequest:
    """What Query is asked."""
    return telemetry_pb2.QueryRequest(
        robot=robot, topics=patterns(topics), start=start, end=end, limit=limit, newest_first=newest_first
    )


class EventPosition:
    """The position of an event subscription: where it resumes when the connection was lost."""

    def __init__(self, after: int | None, kinds: Names | None, robots: Names | None) -> None:
        self._after = after
        self._filter = events_pb2.EventFilter(kinds=patterns(kinds), robots=patterns(robots))

    def request(self) -> events_pb2.WatchEventsRequest:
        """What WatchEvents is asked now; without a cursor it begins with what happens from now on."""
        return events_pb2.WatchEventsRequest(after=self._after, filter=self._filter)

    def events(self, reply: events_pb2.WatchEventsReply) -> Iterator[Event]:
        """Of a reply; the cursor moves with each."""
        if self._after is None:
            self._after = reply.next
        for event in reply.events:
            self._after = event.cursor
            yield Event(event.cursor, event.kind, event.robot, event.time_ns, json.loads(event.data_json or "{}"))
        self._after = max(self._after, reply.next)


def goal_request(
    robot: str, action: str, goal: Mapping[str, Any] | None, *, type_name: str, timeout_s: float, lease_id: str
) -> telemetry_pb2.SendGoalRequest:
    """What SendGoal is asked."""
    return telemetry_pb2.SendGoalRequest(
        robot=robot,
        action=action,
        type_name=type_name,
        json=json.dumps(dict(goal or {})),
        timeout_s=timeout_s,
        lease_id=lease_id,
    )


def goal_update(reply: telemetry_pb2.GoalReply) -> GoalUpdate:
    """How a goal goes."""
    return GoalUpdate(reply.kind, reply.status, json.loads(reply.json) if reply.json else None, reply.message)


def refusal(error: Any) -> MetarosError:
    """A call's error as ours: with the gateway's code where it came from there."""
    code, text = error.code(), error.details() or ""
    reason = str(dict(error.trailing_metadata() or ()).get("metaros-code", ""))
    if reason:
        return RefusedError(text, status=HTTP_STATUS.get(code, 500), reason=reason)
    if code is grpc.StatusCode.CANCELLED:  # not by us: a gateway that ends breaks its calls off by this, too
        return UnavailableError(f"the gateway ended the call: {text}")
    if code is grpc.StatusCode.UNAVAILABLE:
        return UnavailableError(f"the gateway's gRPC port does not answer: {text}")
    if code is grpc.StatusCode.DEADLINE_EXCEEDED:
        return TimeoutError_("the call's time is over")
    return RefusedError(text or str(code), status=HTTP_STATUS.get(code, 500))


class Samples:
    """Makes samples of replies: channels are introduced once, their codecs are compiled once."""

    def __init__(self, *, decode: bool) -> None:
        self.dropped = 0  # that the gateway gave up, as they were not read in time
        self._decode = decode
        self._channels: dict[int, telemetry_pb2.ChannelInfo] = {}
        self._codecs: dict[int, Any] = {}

    def live(self, reply: telemetry_pb2.SubscribeReply) -> Iterator[Sample | Values]:
        """Of a reply of Subscribe."""
        if reply.HasField("info"):
            self._introduce(reply.info)
        self.dropped += reply.dropped
        for item in reply.samples:
            yield self._sample(item, reply.channel)
        for values in reply.values:
            yield Values(values.robot, values.stamp_ns, dict(values.values))

    def stored(self, reply: telemetry_pb2.QueryReply) -> Iterator[Sample]:
        """Of a reply of Query."""
        for info in reply.channels:
            self._introduce(info)
        for item in reply.samples:
            yield self._sample(item, item.channel)

    def _introduce(self, info: telemetry_pb2.ChannelInfo) -> None:
        self._channels[info.channel] = info
        self._codecs[info.channel] = codec_of(info) if self._decode else None

    def _sample(self, item: telemetry_pb2.Sample, number: int) -> Sample:
        info, read, message = self._channels[number], self._codecs[number], None
        if read is not None:
            try:
                message = read.decode(item.cdr)
            except MetarosError:  # what a robot sends may be anything: the bytes are there
                message = None
        return Sample(
            info.robot, info.topic, info.type_name, item.seq, item.stamp_ns, item.receive_ns, item.cdr, message
        )


def codec_of(info: telemetry_pb2.ChannelInfo) -> Any:
    """What decodes a channel's messages: by the type that is shipped here, or by the robot's own; None: nothing."""
    name, shipped = info.type_name, default_catalogue()
    try:
        if info.encoding != "cdr":
            return None
        if name in shipped and info.type_hash in ("", type_hash(name, shipped)):
            return codec(name, shipped)
        catalogue = Catalogue()
        add_schema_text(name, info.schema.decode("utf-8", "replace"), catalogue)
        return codec(name, catalogue)
    except MetarosError:
        return None
