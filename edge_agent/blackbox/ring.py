"""The ring: MCAP files of a few seconds each, the oldest deleted when there are too many. One thread uses it.

Its folder is on disk, or in memory; then `keep` moves what it holds to one on disk, where it stays part of the ring.

It is bounded in bytes and in recorded time: a clock that jumps, or an hour without an agent, deletes nothing. Nothing
is synced; what a killed agent wrote is there up to its last whole chunk, at most a second less. On a disk that is
nearly full the ring gives its files back before anybody else has to give up something.
"""

from __future__ import annotations

import contextlib
import errno
import logging
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO, Final

from edge_agent.blackbox.latched import retire_latched
from edge_agent.blackbox.mcap_reader import DEPTH_KEY, latched_channels
from edge_agent.blackbox.memory import forget_memory, move_to_disk
from edge_agent.blackbox.publisher import RecordedPublisher
from edge_agent.errors import DiskError
from edge_agent.forwarding.channels import Channel
from metaros.clock import Clock
from metaros.errors import RecordingError
from metaros.limits import LIMITS
from metaros.mcap import McapFile
from metaros.record.bag_index import read_index

__all__ = ["Ring", "RingFile", "free_floor"]

LOG = logging.getLogger("metaros.agent.black_box")
PIECE_S: Final = 10.0
CHUNK_BYTES: Final = 512 * 1024
RETRY_S: Final = 5.0  # a disk that refused is tried again so often
_FLOOR_SHARE, _FLOOR_BYTES = 0.10, 512 * 1024 * 1024  # free space that is not ours, whichever is less
_LATCHED_SHARE: Final = 8
Note = tuple[RecordedPublisher, int]


def free_floor(total_bytes: int) -> int:
    """What stays free on a disk of that size: below it the outbox takes no bulk either."""
    return min(_FLOOR_BYTES, round(_FLOOR_SHARE * total_bytes))


@dataclass(frozen=True, slots=True, kw_only=True)
class RingFile:
    """A closed file of the ring."""

    number: int
    path: Path
    size_bytes: int
    first_ns: int
    last_ns: int
    recorded_s: float
    latched: bool


class Ring:
    """At most `window_s` of recorded time and `limit_bytes`. `trouble` says why nothing is written now, else empty."""

    def __init__(
        self,
        folder: Path,
        clock: Clock,
        *,
        window_s: float,
        limit_bytes: int,
        free: Callable[[], tuple[int, int]],
        open_file: Callable[[Path], BinaryIO] = lambda path: path.open("xb", buffering=0),
        seal: Callable[[Channel, bytes, int, bytes], bytes] | None = None,
        disk: Path | None = None,
    ) -> None:
        """`seal` makes what is kept of a channel's payload, its publisher's GID and number given.

        `disk` is where a ring in memory keeps, and where it has its few latched samples.

        Take over the files that an earlier run left. `free` tells free and all bytes of the disk, or DiskError.
        """
        self.trouble = ""
        self.lost = 0
        self._folder, self._clock, self._free, self._open_file = folder, clock, free, open_file
        self._disk = disk or folder
        self._window_s, self.limit_bytes, self._seal = window_s, limit_bytes, seal
        self._piece_s = min(PIECE_S, window_s / 4)
        self._piece_bytes = min(LIMITS.black_box_piece_bytes, limit_bytes // 8)
        self._pieces: deque[RingFile] = deque()
        self._holders = 0
        self._doomed: list[Path] = []  # left the ring while somebody reads it
        self._file: McapFile[Note] | None = None
        self._stream: BinaryIO | None = None
        self._ids: dict[RecordedPublisher, int] = {}  # these three of the open file
        self._schemas: dict[tuple[str, str, bytes], int] = {}
        self._latched = False
        self._number = 0
        self._opened_s = self._retry_s = 0.0
        self._restore()

    @property
    def latched_path(self) -> Path:
        """Where samples of latched topics are that left the ring."""
        return self._disk / "latched.mcap"

    @property
    def size_bytes(self) -> int:
        """With what waits for its chunk."""
        size = sum(piece.size_bytes for piece in self._pieces)
        return size + (self._file.size_bytes + self._file.pending_bytes if self._file else 0)

    @property
    def span_ns(self) -> tuple[int, int]:
        """Log times of the oldest and the newest message on disk; (0, 0) where there is none."""
        firsts = [piece.first_ns for piece in self._pieces]
        lasts = [piece.last_ns for piece in self._pieces]
        if self._file is not None and self._file.message_count:
            firsts.append(self._file.first_ns)
            lasts.append(self._file.last_ns)
        return (min(firsts), max(lasts)) if firsts else (0, 0)

    def write(self, source: RecordedPublisher, sequence: int, log_ns: int, publish_ns: int, payload: bytes) -> None:
        """Add one message; where the disk does not take it, it is counted, and noted with its publisher."""
        try:
            file = self._file or self._open()
            if file is None:
                self._lose([(source, sequence)])
                return
            channel = self._ids.get(source)
            if channel is None:
                channel = self._ids[source] = self._add(file, source)
        except OSError as error:
            self._lose([(source, sequence)])
            self._failed(error)
            return
        if self._seal is not None:
            payload = self._seal(source.channel, source.publisher.gid, sequence, payload)
        try:
            file.write(channel, log_ns, publish_ns, sequence, payload, (source, sequence))
        except OSError as error:
            self._failed(error)
            return
        if file.size_bytes >= self._piece_bytes:
            self.close_file()
            self._trim()

    def tick(self) -> None:
        """Once a second: put the open chunk on disk, begin a new file when it is time, keep the bounds."""
        if self._file is not None:
            try:
                self._file.flush()
            except OSError as error:
                self._failed(error)
            else:
                self._say("")
        if self._file is not None and self._due():
            self.close_file()
        self._trim()
        self._keep_free()

    def hold(self) -> list[RingFile]:
        """Close the open file; all files, oldest first, which stay until `release`."""
        self.close_file()
        self._holders += 1
        return list(self._pieces)

    def release(self) -> None:
        """A holder has read what it wanted."""
        self._holders -= 1
        if not self._holders:
            for path in self._doomed:
                _unlink(path)
            self._doomed.clear()

    def keep(self) -> None:
        """Something happened: a ring in memory moves all it holds to its disk; what finds no room there stays."""
        self.close_file()
        if self._holders:  # it goes into a recording, which is on disk
            return
        for index, piece in enumerate(self._pieces):
            if piece.path.parent != self._disk:
                try:
                    self._pieces[index] = replace(piece, path=move_to_disk(piece.path, self._disk))
                except DiskError as error:
                    LOG.warning("the black box stays in memory: %s", error)
                    return

    def end(self) -> None:
        """The agent ends in order: all is on disk, and the memory is given back."""
        self.keep()
        if self._folder != self._disk and not any(self._folder.glob("[0-9]*.mcap")):
            forget_memory(self._folder, self._disk)

    def close_file(self, *, index: bool = True) -> None:
        """End the open file, with its index; without it the file is read as that of a killed agent."""
        file, stream = self._file, self._stream
        self._file = self._stream = None
        self._ids.clear()
        self._schemas.clear()
        if file is None or stream is None:
            return
        path = self._path(self._number)
        with stream:
            try:
                if index:
                    file.finish(list, self._lose_and_end)
            except OSError as error:
                self._lose(file.abandon_chunk())
                self._say(f"the black box stops: {error.strerror or error}")
        if not file.message_count:
            _unlink(path)
            return
        recorded_s = self._clock.monotonic_s() - self._opened_s
        self._pieces.append(
            RingFile(
                number=self._number,
                path=path,
                size_bytes=file.size_bytes,
                first_ns=file.first_ns,
                last_ns=file.last_ns,
                recorded_s=recorded_s,
                latched=self._latched,
            )
        )

    def _open(self) -> McapFile[Note] | None:
        """A new file; None while the disk is to be left alone."""
        now_s = self._clock.monotonic_s()
        if now_s < self._retry_s:
            return None
        if not self._keep_free():
            self._retry_s = now_s + RETRY_S
            return None
        self._number += 1
        path = self._path(self._number)
        stream = self._open_file(path)
        try:
            self._file = McapFile(stream, chunk_bytes=min(CHUNK_BYTES, self._piece_bytes))
        except OSError:
            stream.close()
            _unlink(path)
            raise
        self._stream, self._opened_s, self._latched = stream, now_s, False
        return self._file

    def _add(self, file: McapFile[Note], source: RecordedPublisher) -> int:
        """The source's channel in the open file, with its schema as far as it is known by now."""
        channel = source.channel
        key = (channel.type_name, channel.type_hash, channel.schema)
        schema = self._schemas.get(key)
        if schema is None:
            schema = self._schemas[key] = file.add_schema(channel.type_name, channel.schema)
        metadata = source.metadata()
        self._latched = self._latched or DEPTH_KEY in metadata
        return file.add_channel(channel.topic, schema, metadata, encoding=channel.encoding)

    def _due(self) -> bool:
        """Whether the open file, which may still be empty, is old enough."""
        return self._clock.monotonic_s() - self._opened_s >= self._piece_s

    def _trim(self) -> None:
        """Delete the oldest files that are over the bounds: what is left without one must still cover the window."""
        newer_s = sum(piece.recorded_s for piece in self._pieces)
        newer_s += self._clock.monotonic_s() - self._opened_s if self._file else 0.0
        while self._pieces:
            newer_s -= self._pieces[0].recorded_s
            if newer_s < self._window_s and self.size_bytes <= self.limit_bytes:
                return
            self._retire()

    def _keep_free(self) -> bool:
        """On a disk that is nearly full give back file by file; when that is not enough, stop writing: False."""
        try:
            free, total = self._free()
            wanted = free_floor(total) + self._piece_bytes
            while free < wanted and self._pieces:
                self._retire()
                free, total = self._free()
        except DiskError as error:
            self._say(f"the black box stops: {error}")
            return False
        if free >= wanted:
            return True
        self.close_file()
        self._say(f"the black box stops: less than {wanted} bytes are free on its disk")
        return False

    def _retire(self) -> None:
        """The oldest file leaves the ring."""
        piece = self._pieces.popleft()
        if piece.latched:
            limit_bytes = self.limit_bytes // _LATCHED_SHARE
            try:
                retire_latched(self.latched_path, piece.path, limit_bytes=limit_bytes)
            except (OSError, RecordingError) as error:
                LOG.warning("latched samples of %s are forgotten: %s", piece.path.name, error)
        if self._holders:
            self._doomed.append(piece.path)
        else:
            _unlink(piece.path)

    def _failed(self, error: OSError) -> None:
        """The disk does not take more: what was in the open chunk is lost, the oldest file makes room."""
        if self._file is not None:
            self._lose(self._file.abandon_chunk())
        self.close_file(index=False)
        if self._pieces:
            self._retire()
        self._retry_s = self._clock.monotonic_s() + RETRY_S
        self._say(f"the black box stops: {error.strerror or error}")

    def _lose(self, notes: list[Note]) -> None:
        self.lost += len(notes)
        for source, sequence in notes:
            source.publisher.refuse(sequence, "disk")

    def _lose_and_end(self, notes: list[Note]) -> None:
        """No room for the index: rather do without it than take back more."""
        self._lose(notes)
        raise OSError(errno.ENOSPC, "no room for the index")

    def _say(self, trouble: str) -> None:
        if trouble and not self.trouble:
            LOG.warning("%s", trouble)
        elif self.trouble and not trouble:
            LOG.info("the black box records again")
        self.trouble = trouble

    def _restore(self) -> None:
        """What an earlier run left; files that hold nothing readable are deleted."""
        self._folder.mkdir(parents=True, exist_ok=True)
        folders = {self._disk, self._folder}
        for path in (path for folder in folders for path in folder.glob("*.partial")):
            _unlink(path)
        found = (path for folder in folders for path in folder.glob("[0-9]*.mcap"))
        for path in sorted(found, key=lambda path: path.name):
            piece = _found(path, most_s=self._piece_s)
            if piece is None:
                _unlink(path)
                continue
            self._number = max(self._number, piece.number)
            self._pieces.append(piece)
        self._trim()

    def _path(self, number: int) -> Path:
        return self._folder / f"{number:012d}.mcap"


def _found(path: Path, *, most_s: float) -> RingFile | None:
    """A file of an earlier run; a clock that jumped in it makes it no longer than `most_s`."""
    try:
        index = read_index(path)
    except RecordingError:
        return None
    if not index.message_count or not path.stem.isdigit():
        return None
    return RingFile(
        number=int(path.stem),
        path=path,
        size_bytes=index.size_bytes,
        first_ns=index.first_ns,
        last_ns=index.last_ns,
        recorded_s=min((index.last_ns - index.first_ns) / 1e9, most_s),
        latched=bool(latched_channels(index)),
    )


def _unlink(path: Path) -> None:
    with contextlib.suppress(OSError):
        path.unlink(missing_ok=True)
