"""The last samples of latched topics that left the ring: without the map that was sent once, a clip is hard to read.

They live in one small file beside the ring, written anew when a file with such samples leaves it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from edge_agent.blackbox.mcap_reader import DEPTH_KEY, Record, latched_channels, records
from metaros.mcap import McapFile
from metaros.record.bag_index import FileIndex, read_index

__all__ = ["last_of_each", "retire_latched"]

_MOST_PUBLISHERS: Final = 256
_LIMIT_BYTES: Final = 64 << 20
Key = tuple[str, str]


def last_of_each(
    indexes: Iterable[FileIndex], *, before_ns: int = 1 << 63, limit_bytes: int = _LIMIT_BYTES
) -> list[Record]:
    """The samples that a late joiner would have got at `before_ns`, by log time; the newest, where they are many."""
    kept: dict[Key, deque[Record]] = {}
    size_bytes = 0
    for index in indexes:
        latched = latched_channels(index)
        if not latched:
            continue
        for record in records(index, channels=latched, last_ns=before_ns - 1):
            key = (
                f"{record.channel.message_encoding} {record.channel.topic}",
                repr(sorted(record.channel.metadata.items())),
            )
            samples = kept.setdefault(key, deque())
            samples.append(record)
            size_bytes += len(record.payload)
            if len(samples) > int(record.channel.metadata[DEPTH_KEY]):
                size_bytes -= len(samples.popleft().payload)
            while size_bytes > limit_bytes or len(kept) > _MOST_PUBLISHERS:
                size_bytes -= _forget_oldest(kept)
    return sorted((record for samples in kept.values() for record in samples), key=lambda record: record.log_ns)


def _forget_oldest(kept: dict[Key, deque[Record]]) -> int:
    """Let the oldest sample go; how many bytes that frees."""
    key = min(kept, key=lambda one: kept[one][0].log_ns)
    gone = kept[key].popleft()
    if not kept[key]:
        del kept[key]
    return len(gone.payload)


def retire_latched(place: Path, leaving: Path, *, limit_bytes: int) -> None:
    """Take over what of the file that leaves is still the last of its publisher, at most `limit_bytes`, newest first.

    Raises:
        OSError: the disk does not take it; what was there stays.
        RecordingError: a file cannot be read.
    """
    indexes = [read_index(path) for path in (place, leaving) if path.exists()]
    if not any(latched_channels(index) for index in indexes[-1:]):
        return
    schemas = {
        (index.schemas[channel.schema_id].name, channel.metadata.get("type_hash", "")): index.schemas[
            channel.schema_id
        ].data
        for index in indexes
        for channel in latched_channels(index).values()
    }
    names = {id(c): index.schemas[c.schema_id].name for index in indexes for c in index.channels.values()}
    draft = place.with_suffix(".partial")
    try:
        with draft.open("wb", buffering=0) as stream:
            file: McapFile[None] = McapFile(stream)
            channels: dict[int, int] = {}
            for record in last_of_each(indexes, limit_bytes=limit_bytes):
                channel = record.channel
                number = channels.get(id(channel))
                if number is None:
                    name = names[id(channel)]
                    schema = file.add_schema(name, schemas[name, channel.metadata.get("type_hash", "")])
                    number = channels[id(channel)] = file.add_channel(
                        channel.topic, schema, channel.metadata, encoding=channel.message_encoding
                    )
                file.write(number, record.log_ns, record.publish_ns, record.sequence, record.payload, None)
            file.finish(list, lambda _notes: None)
        draft.replace(place)
    except OSError:
        draft.unlink(missing_ok=True)
        raise
