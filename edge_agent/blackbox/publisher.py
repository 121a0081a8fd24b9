"""One publisher of one topic, as the black box knows it: what its MCAP channel says, and which numbers were refused."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

from edge_agent.blackbox.mcap_reader import DEPTH_KEY, GID_KEY
from edge_agent.forwarding.channels import Channel
from edge_agent.forwarding.scope import ROSOUT
from metaros.errors import MetarosError
from metaros.record.ledger import Publisher
from metaros.record.qos_yaml import offered_qos
from metaros.wire import Durability, QoSProfile

__all__ = ["RecordedPublisher", "channel_metadata"]

_MOST_LATCHED: Final = 100  # samples of one publisher that are kept beyond the ring


@dataclass(slots=True, eq=False)
class RecordedPublisher:
    """`publisher` holds the sequence numbers that came and were not written."""

    channel: Channel
    publisher: Publisher

    def metadata(self) -> dict[str, str]:
        """Of this publisher's channel in a file of the ring."""
        found = channel_metadata(self.channel.qos, self.channel.type_hash)
        found[GID_KEY] = self.publisher.gid.hex()
        if depth := self._latched():
            found[DEPTH_KEY] = str(depth)
        return found

    def _latched(self) -> int:
        """How many last samples late joiners get; log lines are not looked back for."""
        return 0 if self.channel.topic == ROSOUT else min(_latched_depth(self.channel.qos), _MOST_LATCHED)


def channel_metadata(qos_text: str, type_hash: str) -> dict[str, str]:
    """What rosbag2 and we write into a channel."""
    return {"offered_qos_profiles": _offered(qos_text), "topic_type_hash": type_hash, "type_hash": type_hash}


@lru_cache(maxsize=256)
def _offered(qos_text: str) -> str:
    profile = _profile(qos_text)
    return offered_qos([profile]) if profile is not None else ""


def _latched_depth(qos_text: str) -> int:
    profile = _profile(qos_text)
    if profile is None or profile.durability is not Durability.TRANSIENT_LOCAL:
        return 0
    return profile.resolved().depth


def _profile(qos_text: str) -> QoSProfile | None:
    """The profile of rmw_zenoh's text; None where a peer wrote something else."""
    try:
        return QoSProfile.decode(qos_text) if qos_text else None
    except MetarosError:
        return None
