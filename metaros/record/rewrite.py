"""A new recording out of an old one: a piece of it, its split files as one, or what a killed recorder left.

Payloads, schemas, channels, stamps and sequence numbers are copied as they are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from metaros.errors import ConfigError, RecordingError
from metaros.mcap import McapFile
from metaros.record.bag import Bag, BagMessage, BagTopic
from metaros.record.ledger import GAPS

__all__ = ["Rewritten", "rewrite"]

_COPIED: Final = ("rosbag2",)
_CHUNK_BYTES: Final = 4 << 20


@dataclass(frozen=True, slots=True)
class Rewritten:
    """What the new file holds."""

    path: Path
    messages: int
    size_bytes: int
    first_ns: int
    last_ns: int


def rewrite(
    bag: Bag,
    output: str | Path,
    *,
    topics: Sequence[str] = (),
    start_s: float = 0.0,
    duration_s: float | None = None,
    compression: str = "zstd",
    damaged: Callable[[str], object] | None = None,
    change: Callable[[BagMessage], BagMessage | None] | None = None,
) -> Rewritten:
    """Copy what lies within `start_s` and `duration_s` of the recording's begin into one new .mcap file.

    `change` makes what is written of a message; None leaves it out.

    ConfigError when `output` is there or is no .mcap name; RecordingError when a chunk is damaged, unless `damaged`
    is told of it, or when the disk does not take the file, which is removed then.
    """
    path = Path(output)
    if path.suffix != ".mcap":
        raise ConfigError(f"{path}: the new recording is one file, its name ends in .mcap")
    if path.exists():
        raise ConfigError(f"{path} is there already, and is not overwritten")
    start_ns = bag.first_ns + round(start_s * 1e9) if start_s else 0
    end_ns = 1 << 63 if duration_s is None else bag.first_ns + round((start_s + duration_s) * 1e9)
    try:
        with path.open("xb", buffering=0) as stream:
            file: McapFile[None] = McapFile(stream, compression=compression, chunk_bytes=_CHUNK_BYTES)
            channels: dict[BagTopic, int] = {}
            for found in bag.messages(topics, start_ns=start_ns, end_ns=end_ns, damaged=damaged):
                message = found if change is None else change(found)
                if message is None:
                    continue
                channel = channels.get(message.topic)
                if channel is None:
                    channel = channels[message.topic] = _add_channel(file, message.topic)
                file.write(channel, message.log_ns, message.publish_ns, message.sequence, message.data, None)
            metadata = _metadata(bag, {topic.name for topic in channels})
            file.finish(lambda: metadata, _no_space)
    except OSError as error:
        path.unlink(missing_ok=True)
        raise RecordingError(f"cannot write {path}: {error.strerror or error}") from None
    except BaseException:
        path.unlink(missing_ok=True)
        raise
    first_ns = file.first_ns if file.message_count else 0
    return Rewritten(path, file.message_count, file.size_bytes, first_ns, file.last_ns)


def _add_channel(file: McapFile[None], topic: BagTopic) -> int:
    schema = file.add_schema(topic.type_name, topic.schema.encode())
    metadata = {"offered_qos_profiles": topic.qos_text}
    if topic.type_hash:
        metadata |= {"topic_type_hash": topic.type_hash, "type_hash": topic.type_hash}
    return file.add_channel(topic.name, schema, metadata, encoding=topic.encoding)


def _metadata(bag: Bag, topics: set[str]) -> list[tuple[str, dict[str, str]]]:
    """The accounts of the topics that are in it, and what rosbag2 keeps in each file."""
    copied: list[tuple[str, dict[str, str]]] = []
    for name, record in (item for file in bag.files for item in file.metadata):
        if name == GAPS:
            copied.append((name, {key: text for key, text in record.items() if key.partition(" ")[0] in topics}))
        elif name in _COPIED and (name, record) not in copied:
            copied.append((name, record))
    return copied


def _no_space(_notes: list[None]) -> None:
    raise OSError("no space left for the whole of it")
