"""Where a recording goes: one .mcap file, or a folder like rosbag2's with split files and a metadata.yaml.

A file is valid whenever it is closed, also when the disk is full: then the recording ends with a RecordingError that
says what was kept.
"""

from __future__ import annotations

import errno
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Final

import yaml

from metaros.errors import ConfigError, RecordingError
from metaros.mcap import COMPRESSIONS, McapFile
from metaros.record.ledger import GAPS, Ledger, Publisher
from metaros.record.qos_yaml import offered_qos, qos_entries
from metaros.record.sample_queue import Arrival, Route

__all__ = ["BagOptions", "BagOutput", "WrittenFile"]

METADATA: Final = "metadata.yaml"
_VERSION: Final = 9  # of rosbag2's metadata
_OWN: Final = {"serialized_metadata": yaml.safe_dump({"version": _VERSION, "storage_identifier": "mcap"})}
_CHAR: Final = re.compile(r"^char[ \[]", re.MULTILINE)  # rosbags hashes it otherwise than ROS 2, and refuses the folder
Note = tuple[Publisher, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class BagOptions:
    """How a recording is written. `split_*` 0: never; splitting needs a folder. `open_file` is for tests."""

    compression: str = "zstd"
    chunk_bytes: int = 1 << 20
    chunk_s: float = 1.0  # a sample is on disk after so long at the latest
    split_bytes: int = 0
    split_s: float = 0.0
    continues: bool = True
    open_file: Callable[[Path], BinaryIO] = lambda path: path.open("xb", buffering=0)

    def __post_init__(self) -> None:
        """ConfigError for a compression that there is not."""
        if self.compression not in COMPRESSIONS:
            raise ConfigError(f"{self.compression!r} is no compression: one of {', '.join(COMPRESSIONS)}")

    def check(self, path: Path) -> None:
        """ConfigError for what cannot be written to `path`."""
        if path.suffix == ".mcap" and (self.split_bytes or self.split_s):
            raise ConfigError(f"splitting makes several files: name a folder, {path.with_suffix('')}, not {path.name}")
        if path.exists():
            raise ConfigError(f"{path} is there already, and is not overwritten")


@dataclass(frozen=True, slots=True)
class WrittenFile:
    """One closed file of a recording."""

    path: Path
    messages: int
    first_ns: int
    last_ns: int
    size_bytes: int
    counts: dict[Route, int]
    missing: dict[str, dict[str, int]]  # by topic and reason


class BagOutput:
    """Writes arrivals to `path`: a file when it ends in .mcap, else a new folder. Used by one thread."""

    def __init__(self, path: Path, options: BagOptions) -> None:
        options.check(path)
        self.path = path
        self.files: list[WrittenFile] = []
        self._options = options
        self._qos: dict[Route, str] = {}
        self._number = 0
        self._began_ns: int | None = None  # the first sample of the open file
        self._publishers: dict[Publisher, None] = {}
        try:
            if path.suffix != ".mcap":
                path.mkdir(parents=True)
            self._open()
        except OSError as error:
            raise RecordingError(f"cannot write {path}: {error.strerror or error}") from None

    def write(self, arrival: Arrival, payload: bytes) -> None:
        """Add one sample; RecordingError when the disk does not take it: the output is closed then."""
        try:
            if self._is_due(arrival.log_ns):
                self._roll()
                self._began_ns = arrival.log_ns
            channel = self._channels.get(arrival.route)
            if channel is None:
                channel = self._channel(arrival.route)
            self._ledger.note(arrival.publisher, arrival.sequence)
            self._publishers[arrival.publisher] = None
            self._file.write(
                channel,
                arrival.log_ns,
                arrival.publish_ns,
                arrival.sequence,
                payload,
                (arrival.publisher, arrival.sequence),
            )
        except OSError as error:
            raise self._failure(error) from None

    def flush(self) -> None:
        """Put the open chunk on disk."""
        try:
            self._file.flush()
        except OSError as error:
            raise self._failure(error) from None

    def split(self) -> None:
        """Go on in a new file; RecordingError when the disk does not take it."""
        if self.path.suffix == ".mcap":
            raise ConfigError(f"{self.path.name} is one file: only a recording into a folder can be split")
        try:
            self._roll()
        except OSError as error:
            raise self._failure(error) from None

    def _roll(self) -> None:
        self._finish(())
        self._number += 1
        self._open()

    def close(self, publishers: Iterable[Publisher] = ()) -> None:
        """Close the file and write the folder's metadata; `publishers` are all that were seen.

        RecordingError when not everything fitted on the disk; the files are sound all the same.
        """
        try:
            self._finish(publishers)
            self._write_metadata()
        except OSError as error:
            raise RecordingError(f"cannot finish {self.path}: {error.strerror or error}") from None
        if lost := sum(reasons.get("disk", 0) for file in self.files for reasons in file.missing.values()):
            kept = sum(file.messages for file in self.files)
            raise RecordingError(
                f"{self._place}: the last {lost} messages did not fit on the disk\n"
                f"the recording ends with {kept} messages; it is closed and sound"
            )

    @property
    def size_bytes(self) -> int:
        """What is on disk."""
        return sum(file.size_bytes for file in self.files) + (0 if self._stream.closed else self._file.size_bytes)

    def missing(self) -> dict[str, dict[str, int]]:
        """By topic and reason, how many samples are not in the open file."""
        return self._ledger.counts()

    def _open(self) -> None:
        single = self.path.suffix == ".mcap"
        self._place = self.path if single else self.path / f"{self.path.name}_{self._number}.mcap"
        options = self._options
        self._stream = options.open_file(self._place)
        try:
            self._file: McapFile[Note] = McapFile(
                self._stream, compression=options.compression, chunk_bytes=options.chunk_bytes
            )
        except OSError:
            self._stream.close()
            self._place.unlink(missing_ok=True)
            raise
        self._ledger = Ledger(continues=options.continues)
        self._schemas: dict[str, int] = {}
        self._channels: dict[Route, int] = {}
        self._began_ns = None

    def _is_due(self, log_ns: int) -> bool:
        """Whether this sample belongs into a new file."""
        if self._began_ns is None:
            self._began_ns = log_ns
            return False
        options, file = self._options, self._file
        if options.split_s and log_ns - self._began_ns >= options.split_s * 1e9:
            return True
        return bool(options.split_bytes) and file.size_bytes + file.pending_bytes >= options.split_bytes

    def _channel(self, route: Route) -> int:
        """The channel of a topic, with its schema, written at its first sample in this file."""
        text = route.schema or ""
        key = f"{route.type_name} {route.type_hash}"
        if key not in self._schemas:
            self._schemas[key] = self._file.add_schema(route.type_name, text.encode())
        qos = self._qos.setdefault(route, offered_qos(route.qos))
        metadata = {"offered_qos_profiles": qos, "topic_type_hash": route.type_hash, "type_hash": route.type_hash}
        channel = self._channels[route] = self._file.add_channel(route.topic, self._schemas[key], metadata)
        return channel

    def _finish(self, publishers: Iterable[Publisher]) -> None:
        """Close the open file with its account."""
        if self._stream.closed:
            return
        file, ledger = self._file, self._ledger
        ledger.close(publishers)
        try:
            file.finish(lambda: [(GAPS, ledger.record()), ("rosbag2", _OWN)], ledger.take_back)
        finally:
            self._stream.close()
            counts = file.counts()
            written = {route: counts.get(channel, 0) for route, channel in self._channels.items()}
            first = file.first_ns if file.message_count else 0
            self.files.append(
                WrittenFile(
                    self._place, file.message_count, first, file.last_ns, file.size_bytes, written, ledger.counts()
                )
            )

    def _failure(self, error: OSError) -> RecordingError:
        """The disk does not take more: give up the open chunk, close what is there."""
        reason = "the disk is full" if error.errno in (errno.ENOSPC, errno.EDQUOT) else error.strerror or str(error)
        kept = "the index could not be written: `metaros bag recover` reads it"
        if not self._stream.closed:
            self._ledger.take_back(self._file.abandon_chunk())
            try:
                self._finish(self._publishers)
                kept = "it is closed and sound"
            except OSError:
                pass
        try:
            self._write_metadata()
        except OSError:
            kept += "; metadata.yaml could not be written"
        messages = sum(file.messages for file in self.files)
        return RecordingError(f"{self._place}: {reason}\nthe recording ends with {messages} messages; {kept}")

    def _write_metadata(self) -> None:
        """The folder's metadata.yaml, whole or not at all."""
        if self.path.suffix == ".mcap":
            return
        draft = self.path / f"{METADATA}.tmp"
        try:
            draft.write_text(yaml.safe_dump(_metadata(self.files, self._qos), sort_keys=False))
            draft.replace(self.path / METADATA)
        except OSError:
            draft.unlink(missing_ok=True)
            raise


def _metadata(files: list[WrittenFile], qos: dict[Route, str]) -> dict[str, Any]:
    """rosbag2's description of a folder."""
    counts: dict[Route, int] = {}
    for file in files:
        for route, count in file.counts.items():
            counts[route] = counts.get(route, 0) + count
    spans = [(file.first_ns, file.last_ns) for file in files if file.messages]
    start, end = min((first for first, _ in spans), default=0), max((last for _, last in spans), default=0)
    topics = [
        {
            "topic_metadata": {
                "name": route.topic,
                "type": route.type_name,
                "serialization_format": "cdr",
                "offered_qos_profiles": yaml.safe_load(qos[route]) if qos[route] else qos_entries([]),
                "type_description_hash": "" if _CHAR.search(route.schema or "") else route.type_hash,
            },
            "message_count": count,
        }
        for route, count in counts.items()
    ]
    information = {
        "version": _VERSION,
        "storage_identifier": "mcap",
        "duration": {"nanoseconds": end - start},
        "starting_time": {"nanoseconds_since_epoch": start},
        "message_count": sum(file.messages for file in files),
        "topics_with_message_count": topics,
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file.path.name for file in files],
        "files": [
            {
                "path": file.path.name,
                "starting_time": {"nanoseconds_since_epoch": file.first_ns},
                "duration": {"nanoseconds": max(0, file.last_ns - file.first_ns)},
                "message_count": file.messages,
            }
            for file in files
        ],
        "custom_data": None,
        "ros_distro": "metaros",
    }
    return {"rosbag2_bagfile_information": information}
