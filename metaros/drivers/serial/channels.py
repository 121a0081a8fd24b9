"""The topics of one board: what it declared, made publishers and subscriptions of the driver's node."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from metaros.cdr import codec
from metaros.drivers.context import DriverContext
from metaros.drivers.serial.outgoing import Outgoing
from metaros.drivers.serial.protocol import Answer, Declare
from metaros.errors import DecodeError, MetarosError
from metaros.idl import message_class, names
from metaros.idl.globs import Glob

__all__ = ["MAX_CHANNELS", "Channels", "may_use"]

MAX_CHANNELS: Final = 32
MOVES: Final = ("cmd_vel",)  # topics that a glob does not open: they are named, or stay shut


def may_use(topic: str, patterns: str) -> bool:
    """Whether one of the comma-separated globs has the relative topic; what moves something must be named as it is."""
    listed = [part.strip().lstrip("/") for part in patterns.split(",") if part.strip()]
    if topic.rpartition("/")[2] in MOVES:
        return topic in listed
    return any(Glob(pattern).matches(topic) for pattern in listed)


class Channels:
    """Channel numbers of the board, each with its codec and its publisher or subscription. The device's thread owns it;
    subscriptions call on the executor's.
    """

    def __init__(self, context: DriverContext, outgoing: Outgoing) -> None:
        self._context = context
        self._outgoing = outgoing
        self._open: dict[int, tuple[Declare, Any, Callable[[bytes], Any]]] = {}

    def __len__(self) -> int:
        return len(self._open)

    def declare(self, wanted: Declare) -> Answer:
        """Open it, or say why not; the same declaration again changes nothing, another one replaces the channel."""
        known = self._open.get(wanted.channel)
        if known is not None and known[0] == wanted:
            return Answer.ACCEPTED
        if known is None and len(self._open) >= MAX_CHANNELS:
            return Answer.TOO_MANY
        try:
            names.validate_topic(wanted.topic)
        except MetarosError:
            return Answer.BAD_TOPIC
        if wanted.topic.startswith(("/", "~")):
            return Answer.BAD_TOPIC
        if not may_use(wanted.topic, self._context["publish" if wanted.publishes else "subscribe"]):
            return Answer.NOT_ALLOWED
        try:
            message_type = message_class(wanted.type_name)
        except MetarosError:
            return Answer.UNKNOWN_TYPE
        if known is not None:
            self._close(wanted.channel)
        self._open[wanted.channel] = (wanted, self._made(wanted, message_type), codec(message_type).decode)
        return Answer.ACCEPTED

    def publish(self, channel: int, data: bytes) -> None:
        """Publish a board's CDR, once it is known to be of the declared type. Raises DecodeError."""
        known = self._open.get(channel)
        if known is None or not known[0].publishes:
            raise DecodeError(f"data on channel {channel}, which the board has not declared")
        _, publisher, decode = known
        publisher.publish(decode(data), stamp_ns=self._context.clock.wall_ns())

    def close(self) -> None:
        """Forget all: the board is gone, or began anew."""
        for channel in list(self._open):
            self._close(channel)
        self._outgoing.clear()

    def _made(self, wanted: Declare, message_type: type[Any]) -> Any:
        context = self._context
        if wanted.publishes:
            return context.publisher(message_type, wanted.topic)

        def forward(data: bytes) -> None:
            self._outgoing.put(wanted.channel, bytes(data))

        return context.subscription(message_type, wanted.topic, forward, raw=True)

    def _close(self, channel: int) -> None:
        _, endpoint, _ = self._open.pop(channel)
        self._outgoing.drop(channel)
        self._context.release(endpoint)
