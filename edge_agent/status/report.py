"""An agent's status as a JSON-able report: from a running agent, or read from the directory of a stopped one.

Reading changes nothing and takes no lock: a running agent may be writing meanwhile.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, cast

from edge_agent.blackbox.memory import KEPT_IN_MEMORY
from edge_agent.blackbox.recording_store import RecordingStore
from edge_agent.blackbox.setup import BOX_FOLDER, RECORDINGS_FOLDER
from edge_agent.errors import CorruptError
from edge_agent.link.byte_budget_override import stored_limit
from edge_agent.outbox import CLASSES, LOGS, Disk, Outbox
from edge_agent.outbox.reader import Segment
from edge_agent.outbox.segment import SegmentHeader, read_header, scan
from edge_agent.outbox.state import OutboxState
from edge_agent.state.store_id import StoreId
from edge_agent.twin.state import TwinFile
from edge_agent.uplink.queues import Queues
from edge_agent.uplink.statistics import LinkFacts, class_depth
from metaros._proto import link_pb2

__all__ = ["held_report", "running_report"]

_FIRST_BYTES = 256 * 1024
_MOST_HEADER = 4 * 1024 * 1024
_NUMBERS = ("fresh_bytes", "backfill_bytes", "samples", "lost", "disk_bytes", "quota_bytes")
Report = dict[str, Any]


class _Looked:
    """A directory as a disk that is only read, and not even made."""

    def __init__(self, root: Path) -> None:
        self._root = root

    def size(self, name: str) -> int:
        """Bytes of a file; 0 when there is none."""
        path = self._root / name
        return path.stat().st_size if path.is_file() else 0

    def read(self, name: str, offset: int, size: int) -> bytes:
        """At most `size` bytes of a file."""
        with (self._root / name).open("rb") as file:
            file.seek(offset)
            return file.read(size)


def running_report(
    queues: Queues, facts: LinkFacts, *, directory: Path, store_id: str, facts_of_robot: Mapping[str, Any]
) -> Report:
    """What an agent says of itself."""
    outbox, live, budget = queues.outbox, queues.live, queues.budget
    classes = [_class_row(class_depth(outbox, name), oldest_ns(outbox, directory, name)) for name in CLASSES]
    depth = link_pb2.ClassDepth(
        name="live", fresh_bytes=live.size_bytes, samples=len(live), lost=live.dropped, quota_bytes=live.max_bytes
    )
    return {
        **facts_of_robot,
        "running": True,
        "pid": os.getpid(),
        "directory": str(directory),
        "linked": outbox.online,
        "transport": facts.transport,
        "gateway": facts.gateway,
        "reconnects": facts.reconnects,
        "store_id": store_id,
        "budget_bytes_per_s": budget.limit_bytes_per_s or None,
        "sent_bytes_per_s": round(budget.sent_bytes_per_s, 1),
        "disk_free_bytes": outbox.free_bytes,
        "epochs": [f"{epoch:016x}" for epoch in outbox.state.epochs.values()],
        "classes": [*classes, _class_row(depth, None)],
        "black_box": _box_row(facts.black_box() if facts.black_box is not None else link_pb2.BlackBox()),
        "recordings": _shelf_row(queues.recordings),
        "twin": twin_row(directory),
    }


def held_report(directory: Path) -> Report:
    """What a state directory holds. What was acknowledged and is not deleted yet counts as held: nobody noted that."""
    rows = []
    for name, policy in CLASSES.items():
        logs = {log: list(segments(directory / "outbox" / log)) for log in LOGS if log.partition("_")[0] == name}
        counted = {log: _count(found) for log, found in logs.items()}
        sizes = {log: sum(segment.end for segment in found) for log, found in logs.items()}
        depth = link_pb2.ClassDepth(
            name=name,
            fresh_bytes=sizes[name] if counted[name] else 0,
            backfill_bytes=sum(size for log, size in sizes.items() if log != name and counted[log]),
            samples=sum(counted.values()),
            disk_bytes=sum(sizes.values()),
            quota_bytes=policy.quota_bytes,
        )
        firsts = [_oldest(found[0], {}) for log, found in logs.items() if found and counted[log]]
        rows.append(_class_row(depth, min((first for first in firsts if first), default=None)))
    disk = cast(Disk, _Looked(directory))
    state = OutboxState.load(cast(Disk, _Looked(directory / "outbox")))
    return {
        "name": directory.name,
        "running": False,
        "directory": str(directory),
        "store_id": StoreId(disk).value,
        "budget_bytes_per_s": stored_limit(disk) or None,
        "disk_free_bytes": shutil.disk_usage(directory).free,
        "epochs": [f"{epoch:016x}" for epoch in state.epochs.values()] if state is not None else [],
        "classes": rows,
        "black_box": _left_box(directory / BOX_FOLDER),
        "recordings": _left_recordings(directory / RECORDINGS_FOLDER),
        "twin": twin_row(directory),
    }


def twin_row(directory: Path) -> Report:
    """The twin's state, by its record: `revision` is the newest that came, `applied` the one in force.

    `state` is applied, on trial, reverted or refused; revision 0 is the robot's own settings.
    """
    record = TwinFile(cast(Disk, _Looked(directory))).load()
    pending = record.pending
    return {
        "revision": record.seen,
        "applied": (pending.version if pending is not None else record.applied).revision,
        "state": "on trial" if pending is not None else record.undone or "applied",
        "code": record.code,
        "message": record.message,
    }


def oldest_ns(outbox: Outbox, directory: Path, delivery: str) -> int | None:
    """When the oldest of a class's waiting samples was accepted; None when none waits."""
    found = []
    for name, log in outbox.logs.items():
        if name.partition("_")[0] == delivery and log.segments and not log.empty:
            marks = {stream: seq for (era, stream), seq in log.acked.items() if era == log.segments[0].header.era}
            found.append(_oldest(_located(log.segments[0], directory), marks))
    return min((wall_ns for wall_ns in found if wall_ns), default=None)


def segments(folder: Path) -> Iterable[Segment]:
    """The readable segments of a log, `name` being the file's path."""
    for path in sorted(folder.glob("*.seg")):
        try:
            with path.open("rb") as file:
                header, start = read_header(file.read(_MOST_HEADER))
                size = os.fstat(file.fileno()).st_size
        except (OSError, CorruptError):
            continue
        yield Segment(int(path.stem) if path.stem.isdigit() else 0, str(path), header, start, size)


def _located(segment: Segment, directory: Path) -> Segment:
    path = str(directory / "outbox" / segment.name)
    return Segment(segment.number, path, segment.header, segment.start, segment.end)


def _count(found: list[Segment]) -> int:
    """Samples between the first segment's beginning and the last one's end, era by era."""
    total = 0
    for era in dict.fromkeys(segment.header.era for segment in found):
        of_era = [segment for segment in found if segment.header.era == era]
        newest = _newest(of_era[-1])
        total += sum(seq - of_era[0].header.last.get(stream, 0) for stream, seq in newest.items())
    return total


def _newest(segment: Segment) -> dict[int, int]:
    header: SegmentHeader = segment.header
    newest = {**header.last, **header.until}
    for frame in scan(Path(segment.name).read_bytes()[segment.start :]).frames:
        newest[frame.stream_id] = max(newest.get(frame.stream_id, 0), frame.last_seq)
    return newest


def _oldest(segment: Segment, acked: Mapping[int, int]) -> int | None:
    """When the first frame that is not acknowledged was accepted, as far as the segment's first bytes tell."""
    try:
        with open(segment.name, "rb") as file:
            file.seek(segment.start)
            frames = scan(file.read(_FIRST_BYTES)).frames
    except OSError:
        return None
    waiting = [frame for frame in frames if frame.last_seq > acked.get(frame.stream_id, 0)]
    return (waiting or frames)[0 if waiting else -1].wall_ns if frames else None


def _box_row(box: link_pb2.BlackBox) -> Report:
    return {name: getattr(box, name) for name in ("from_ns", "to_ns", "size_bytes", "quota_bytes", "lost")}


def _shelf_row(recordings: RecordingStore | None) -> Report:
    return {"count": len(recordings) if recordings else 0, "size_bytes": recordings.size_bytes if recordings else 0}


def _left_box(folder: Path) -> Report:
    """The ring of an agent that does not run, by its files alone."""
    places = (folder, folder / KEPT_IN_MEMORY)
    facts = [path.stat() for place in places for path in sorted(place.glob("[0-9]*.mcap"))]
    box = link_pb2.BlackBox(size_bytes=sum(fact.st_size for fact in facts))
    if facts:
        box.to_ns = max(fact.st_mtime_ns for fact in facts)
    return _box_row(box)


def _left_recordings(folder: Path) -> Report:
    sizes = [path.stat().st_size for path in folder.glob("*.mcap")]
    return {"count": len(sizes), "size_bytes": sum(sizes)}


def _class_row(depth: link_pb2.ClassDepth, oldest: int | None) -> Report:
    return {"name": depth.name, **{number: getattr(depth, number) for number in _NUMBERS}, "oldest_ns": oldest}
