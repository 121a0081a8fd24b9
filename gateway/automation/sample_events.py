"""Stored samples as events: each message as JSON, within bounds, or only named where nobody here can read it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from gateway.domain.automation.gateway_event import TOPIC, GatewayEvent
from gateway.domain.channel import Channel
from gateway.domain.decoder import Decoder
from gateway.domain.sample import Sample
from gateway.store.writes import StreamWrite
from metaros.errors import MetarosError
from metaros.limits import LIMITS, Limits

__all__ = ["SampleReader", "sample_event"]


class SampleReader:
    """Used by one thread; `begin` gives it the bytes that it may decode from then on."""

    def __init__(self, *, limits: Limits = LIMITS) -> None:
        self._decoder = Decoder()
        self._limits = limits
        self._room = limits.rule_decoded_bytes

    def begin(self) -> None:
        """Another commit, or page of history."""
        self._room = self._limits.rule_decoded_bytes

    def gateway_events(self, write: StreamWrite) -> Iterator[GatewayEvent]:
        """Every sample of a write; one without samples has none."""
        if write.run is None:
            return
        for sample in write.run.samples():
            yield self.read(write.robot, write.stream_id, write.epoch, sample)

    def read(self, robot: str, stream_id: int, epoch: int, sample: Sample) -> GatewayEvent:
        """One sample. What is sealed, too large, past the bound of this commit, or of no known type is omitted."""
        size = len(sample.payload)
        said: dict[str, Any] = {}
        if size > self._limits.rule_message_bytes:
            reason = "too_large"
        elif size > self._room:
            reason = "busy"
        else:
            self._room -= size
            try:
                said["message"] = self._decoder.decode(sample.channel, bytes(sample.payload))
                reason = ""
            except MetarosError as error:
                reason = error.code
        if reason:
            said["omitted"] = {"reason": reason, "size_bytes": size, "stream": stream_id, "epoch": str(epoch)}
        return sample_event(robot, stream_id, epoch, sample.seq, sample.stamp_ns, sample.channel, said)


def sample_event(
    robot: str, stream_id: int, epoch: int, seq: int, stamp_ns: int, channel: Channel, said: dict[str, Any]
) -> GatewayEvent:
    """The event of a sample; `said` has its `message`, or why it is `omitted`."""
    return GatewayEvent(
        id=f"{robot}/{stream_id}/{epoch}/{seq}",
        type=TOPIC,
        source="metaros.topic",
        at_ns=stamp_ns,
        robot=robot,
        data={"topic": channel.topic, "type": channel.schema_name, "stamp_ns": stamp_ns, "seq": seq, **said},
    )
