"""Who is on DDS: the writers and readers of other participants, as DDS's own built-in topics tell."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any, Final
from uuid import UUID

from cyclonedds.builtin import (
    BuiltinDataReader,
    BuiltinTopicDcpsPublication,
    BuiltinTopicDcpsSubscription,
)
from cyclonedds.core import InstanceState, Policy, Qos
from cyclonedds.domain import DomainParticipant

from metaros.dds.names import parse_topic, parse_type
from metaros.dds.plan import DdsEndpoint
from metaros.dds.qos import from_dds
from metaros.limits import LIMITS

__all__ = ["Discovery"]

_TAKE: Final = 256  # endpoints at a time
_HASH: Final = re.compile(rb"typehash=(RIHS01_[0-9a-f]{64});")


class Discovery:
    """Follows up to `LIMITS.graph_entities` endpoints of others. Not thread-safe: the bridge's thread calls it."""

    def __init__(self, participant: DomainParticipant) -> None:
        self._own = participant.guid
        self._found: dict[UUID, DdsEndpoint] = {}
        self.left_out = 0  # endpoints beyond the limit
        self.readers: Final = (
            BuiltinDataReader(participant, BuiltinTopicDcpsPublication),
            BuiltinDataReader(participant, BuiltinTopicDcpsSubscription),
        )

    @property
    def endpoints(self) -> Iterable[DdsEndpoint]:
        """Those that are there."""
        return self._found.values()

    @property
    def participants(self) -> int:
        """How many others have some."""
        return len({endpoint.participant for endpoint in self._found.values()})

    def refresh(self) -> bool:
        """Take what DDS has found; whether anything changed."""
        changed = False
        for writes, reader in zip((True, False), self.readers, strict=True):
            while items := reader.take(_TAKE):
                for item in items:
                    changed |= self._take(item, writes=writes)
        return changed

    def _take(self, item: Any, *, writes: bool) -> bool:
        if item.sample_info.instance_state != InstanceState.Alive or not item.sample_info.valid_data:
            return self._found.pop(item.key, None) is not None
        if item.participant_key == self._own:
            return False
        name = parse_topic(item.topic_name)
        if name is None:
            return False
        type_name = parse_type(name.kind, item.type_name)
        endpoint = DdsEndpoint(
            writes, name.kind, name.name, type_name, _type_hash(item.qos), from_dds(item.qos), item.participant_key
        )
        known = self._found.get(item.key)
        if known is None and len(self._found) >= LIMITS.graph_entities:
            self.left_out += 1
            return self.left_out == 1
        changed = known != endpoint
        self._found[item.key] = endpoint
        return changed


def _type_hash(qos: Qos) -> str:
    told = qos[Policy.Userdata]
    match = _HASH.search(told.data) if told is not None else None
    return match[1].decode() if match else ""
