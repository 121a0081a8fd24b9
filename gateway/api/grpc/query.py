"""Stored messages as replies of Query: page by page, made on the history's threads, never more than a page ahead."""

from __future__ import annotations

from collections.abc import AsyncGenerator, Sequence
from dataclasses import replace

import orjson

from gateway.api.grpc.authenticate import Call
from gateway.api.grpc.fields import FieldFaultError
from gateway.api.rest.ranges import chosen_topics, parse_range
from gateway.domain.channel import Channel
from gateway.domain.decoder import Decoder
from gateway.history.cursor import read_cursor
from gateway.history.losses import Loss, merged_losses
from gateway.history.messages import Message
from gateway.history.pages import Page, PageRequest
from metaros._proto import telemetry_pb2
from metaros.errors import MetarosError

__all__ = ["QueryReplies", "info"]

PAGE_MESSAGES = 1000
MAX_TOPICS = 64
REPLY_BYTES = 1024 * 1024  # of payloads, well below what clients take by default


class QueryReplies:
    """One call of Query."""

    def __init__(self, request: telemetry_pb2.QueryRequest, call: Call) -> None:
        self._request = request
        self._call = call
        self._json = request.encoding == telemetry_pb2.ENCODING_JSON
        self._decoder = Decoder()
        self._numbers: dict[object, int] = {}

    async def replies(self) -> AsyncGenerator[telemetry_pb2.QueryReply, None]:
        """Replies of at most `REPLY_BYTES`, or one message; the last of a page has a cursor, the very last none."""
        history, left = self._call.services.history, self._request.limit
        asked, first = await self._asked(), True
        while True:
            limit = min(left, PAGE_MESSAGES) if self._request.limit else PAGE_MESSAGES
            replies = await history.viewed(replace(asked, limit=limit), view=self._first if first else self._later)
            for reply in replies:
                yield reply
                left -= len(reply.samples)
            cursor = replies[-1].cursor
            if not cursor or (self._request.limit and left <= 0):
                return
            asked, first = replace(asked, after=read_cursor(cursor, newest_first=asked.newest_first)), False

    async def _asked(self) -> PageRequest:
        request, services = self._request, self._call.services
        if len(request.topics) > MAX_TOPICS:
            raise FieldFaultError("topics", f"topics has at most {MAX_TOPICS} names or patterns")
        namespace = services.registry.get(request.robot).robot.namespace
        start, end = request.start or "-15m", request.end or "now"
        start_ns, end_ns = parse_range(start, end, now_ns=services.clock.wall_ns())
        names = await services.history.topic_names(request.robot)
        return PageRequest(
            robot_id=request.robot,
            topics=chosen_topics(names, list(request.topics) or None, namespace=namespace),
            start_ns=start_ns,
            end_ns=end_ns,
            limit=PAGE_MESSAGES,
            newest_first=request.newest_first,
            after=read_cursor(request.cursor, newest_first=request.newest_first) if request.cursor else None,
        )

    def _first(self, page: Page, losses: Sequence[Loss]) -> list[telemetry_pb2.QueryReply]:
        return self._replies(page, losses)

    def _later(self, page: Page, _losses: Sequence[Loss]) -> list[telemetry_pb2.QueryReply]:
        return self._replies(page, page.losses)  # those of the range were told with the first page

    def _replies(self, page: Page, losses: Sequence[Loss]) -> list[telemetry_pb2.QueryReply]:
        """On a thread of the history's."""
        replies, size_bytes = [telemetry_pb2.QueryReply()], 0
        for message in page.messages:
            size_bytes += len(message.payload)
            if size_bytes > REPLY_BYTES and replies[-1].samples:
                replies.append(telemetry_pb2.QueryReply())
                size_bytes = len(message.payload)
            number = self._numbers.get(message.channel.identity)
            if number is None:
                number = self._numbers[message.channel.identity] = len(self._numbers) + 1
                replies[-1].channels.append(info(message.channel, number))
            replies[-1].samples.append(self._sample(message, number))
        replies[-1].cursor = page.next or ""
        replies[-1].gaps.extend(gap(loss) for loss in merged_losses(losses))
        return replies

    def _sample(self, message: Message, number: int) -> telemetry_pb2.Sample:
        sample = telemetry_pb2.Sample(
            channel=number, seq=message.seq, stamp_ns=message.stamp_ns, receive_ns=message.receive_ns
        )
        if not self._json:
            sample.cdr = message.payload
            return sample
        try:
            sample.json = orjson.dumps(self._decoder.decode(message.channel, message.payload)).decode()
        except MetarosError as error:
            sample.undecoded = error.code
        return sample


def info(channel: Channel, number: int) -> telemetry_pb2.ChannelInfo:
    """A channel as a client is told of it before its first sample."""
    return telemetry_pb2.ChannelInfo(
        channel=number,
        robot=channel.robot,
        topic=channel.topic,
        type_name=channel.schema_name,
        type_hash=channel.type_hash,
        encoding=channel.encoding,
        schema_encoding=channel.schema_encoding,
        schema=channel.schema,
    )


def gap(loss: Loss) -> telemetry_pb2.StoredGap:
    """A declared loss."""
    return telemetry_pb2.StoredGap(
        topic=loss.topic or "", from_ns=loss.from_ns, to_ns=loss.to_ns, count=loss.count, reason=loss.reason
    )
