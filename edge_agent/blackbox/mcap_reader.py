"""Messages of an MCAP file that the black box wrote, in the order in which they were written. Pure reading.

A file that a killed agent left is read up to its last whole chunk; a damaged chunk is passed over.
"""

from __future__ import annotations

import logging
import struct
from collections.abc import Collection, Iterator
from typing import Final, NamedTuple

from mcap.records import Channel, ChunkIndex

from metaros.errors import RecordingError
from metaros.record.bag_index import FileIndex, read_chunk

__all__ = ["DEPTH_KEY", "GID_KEY", "Record", "latched_channels", "records"]

LOG = logging.getLogger("metaros.agent.black_box")
GID_KEY: Final = "gid"  # of a channel's metadata: whose samples these are, in hex
DEPTH_KEY: Final = "latched"  # likewise: how many last samples the publisher keeps for late joiners
_MESSAGE_OPCODE: Final = 5
_HEAD: Final = struct.Struct("<BQ")
_MESSAGE: Final = struct.Struct("<BQHIQQ")


class Record(NamedTuple):
    """One message as it is in the file."""

    channel: Channel
    sequence: int
    log_ns: int
    publish_ns: int
    payload: bytes


def latched_channels(index: FileIndex) -> dict[int, Channel]:
    """The channels whose publishers keep their last samples for late joiners."""
    return {number: channel for number, channel in index.channels.items() if depth_of(channel)}


def depth_of(channel: Channel) -> int:
    """How many last samples the channel's publisher keeps; 0 where it keeps none."""
    text = channel.metadata.get(DEPTH_KEY, "")
    return int(text) if text.isdigit() else 0


def records(
    index: FileIndex, *, channels: Collection[int] | None = None, first_ns: int = 0, last_ns: int = 1 << 63
) -> Iterator[Record]:
    """What was logged from `first_ns` to `last_ns`, both included; of `channels` alone where they are given."""
    try:
        with index.path.open("rb") as source:
            for chunk in index.chunks:
                if not _concerns(chunk, channels, first_ns, last_ns):
                    continue
                try:
                    raw = read_chunk(source, chunk)
                except RecordingError as error:
                    LOG.warning("%s: %s; it is left out", index.path.name, error)
                    continue
                yield from _of_chunk(raw, index.channels, channels, first_ns, last_ns)
    except OSError as error:
        raise RecordingError(f"cannot read {index.path}: {error.strerror or error}") from None


def _concerns(chunk: ChunkIndex, channels: Collection[int] | None, first_ns: int, last_ns: int) -> bool:
    if chunk.message_end_time < first_ns or chunk.message_start_time > last_ns:
        return False
    offsets = chunk.message_index_offsets  # none where the file has no index
    return channels is None or not offsets or any(channel in offsets for channel in channels)


def _of_chunk(
    raw: bytes, known: dict[int, Channel], channels: Collection[int] | None, first_ns: int, last_ns: int
) -> Iterator[Record]:
    place, end, unpack, size = 0, len(raw), _MESSAGE.unpack_from, _MESSAGE.size
    while place + size <= end:
        opcode, length, channel_id, sequence, log_ns, publish_ns = unpack(raw, place)
        following = place + _HEAD.size + length
        if (
            opcode == _MESSAGE_OPCODE
            and first_ns <= log_ns <= last_ns
            and (channels is None or channel_id in channels)
            and (channel := known.get(channel_id)) is not None
        ):
            yield Record(channel, sequence, log_ns, publish_ns, raw[place + size : following])
        place = following
