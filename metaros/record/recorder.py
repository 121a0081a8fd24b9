"""The data logger: any topics into MCAP files, or into a ring in memory that is saved on request.

Payloads are never decoded. One thread writes; what the disk cannot take in time is dropped at the queue's bound in
bytes, and every sequence number that is not in a file is reported in that file.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from queue import Empty
from typing import Any, Final

from metaros.errors import ClosedError, ConfigError, MetarosError, RecordingError, TimeoutError_
from metaros.executor import SingleThreadedExecutor
from metaros.interfaces.std_srvs.srv import Trigger
from metaros.limits import LIMITS
from metaros.node import Context, Node
from metaros.record.bag_output import BagOptions, BagOutput
from metaros.record.ledger import Publisher
from metaros.record.ring import Ring
from metaros.record.sample_queue import Arrival, Route, SampleQueue
from metaros.record.selection import TopicSelection
from metaros.record.tap import Tap
from metaros.wire.shm import intact

__all__ = ["Recorder", "RecordingReport", "RingOptions"]

_log = logging.getLogger("metaros.record")
_TICK_S: Final = 0.1
_SAVE_S: Final = 60.0
_HELD_BYTES: Final = 512  # that a waiting sample weighs beside its payload
_NAMES: Final = 10_000


@dataclass(frozen=True, slots=True, kw_only=True)
class RingOptions:
    """Keep the last `window_s` seconds in memory, at most `limit_bytes`."""

    window_s: float
    limit_bytes: int = LIMITS.recorder_ring_bytes


@dataclass(slots=True)
class RecordingReport:
    """What a recording holds so far. `missing` is by topic and reason: lost, dropped, paused, disk."""

    topics: int = 0
    received: int = 0
    received_bytes: int = 0
    written: int = 0
    size_bytes: int = 0
    waiting_bytes: int = 0
    malformed: int = 0
    dropped: int = 0
    paused: bool = False
    ring_s: float = 0.0
    missing: dict[str, dict[str, int]] = field(default_factory=dict)
    files: list[Path] = field(default_factory=list)


class Recorder:
    """Records from its construction to `close`. Use it as a context manager.

    `output` is a new folder, or one file when it ends in `.mcap`; with `ring`, the folder that saved files go to.
    `topics` are names and globs; topics that appear later join. The recorder is a node, `name`, with the services
    `~/pause`, `~/resume`, `~/split` and `~/save`. `notice` is called, on a thread of the recorder, with what a user
    should know. When the disk fails the recording ends by itself: `failure` says why, and `close` raises it.
    """

    def __init__(
        self,
        context: Context | Node,
        output: str | Path,
        *,
        topics: Sequence[str],
        exclude: Sequence[str] = (),
        hidden: bool = False,
        options: BagOptions | None = None,
        ring: RingOptions | None = None,
        queue_bytes: int = LIMITS.recorder_queue_bytes,
        paused: bool = False,
        name: str = "metaros_recorder",
        notice: Callable[[str], object] = _log.warning,
    ) -> None:
        selection = TopicSelection(topics, exclude, hidden=hidden)
        self.context = context.context if isinstance(context, Node) else context
        self.failure: RecordingError | None = None
        self.ended = threading.Event()
        self._path, self._options, self._notice = Path(output), options or BagOptions(), notice
        self._ring = None if ring is None else _new_ring(ring)
        self._saved: list[Path] = []
        self._written = 0
        self._held: dict[Route, list[tuple[Arrival, bytes]]] = {}  # until their schema is found
        self._held_bytes = 0
        self._closed = False
        self._output = BagOutput(self._path, self._options) if ring is None else None
        self._queue = SampleQueue(self.context.clock, limit_bytes=queue_bytes)
        self._queue.paused = paused
        self._executor = SingleThreadedExecutor()
        self._spinner = threading.Thread(target=self._executor.spin, name="metaros-record-services", daemon=True)
        self._thread = threading.Thread(target=self._run, name="metaros-record-writer", daemon=True)
        self._thread.start()
        try:
            self._node = Node(name, context=self.context, enable_rosout=False, enable_parameters=False)
            self._tap = Tap(self._node, selection, self._queue, ready=self._when_ready, notice=notice)
        except BaseException:
            self._queue.put(None)
            self._thread.join()
            raise
        self._serve()

    @property
    def node_name(self) -> str:
        """Where its services are."""
        return self._node.full_name

    # -- commands --------------------------------------------------------------------------------------------------

    def pause(self) -> None:
        """From now on samples are not recorded, but reported as missing."""
        self._queue.paused = True

    def resume(self) -> None:
        """The reverse of `pause`."""
        self._queue.paused = False

    @property
    def paused(self) -> bool:
        """Whether it is paused."""
        return self._queue.paused

    def split(self) -> None:
        """Go on in a new file."""
        if self._output is None:
            raise ConfigError("a recorder in ring mode has no file to split: save it")
        self._on_writer(self._split)

    def save(self) -> Path:
        """Write the ring to a new file and return its path; a recording without a ring puts its open chunk on disk."""
        path: Path = self._on_writer(self._save)
        return path

    def report(self) -> RecordingReport:
        """So far."""
        routes = list(self._tap.routes.values())
        output, ring = self._output, self._ring
        return RecordingReport(
            topics=sum(route.received > 0 for route in routes),
            received=sum(route.received for route in routes),
            received_bytes=sum(route.received_bytes for route in routes),
            written=self._written,
            size_bytes=output.size_bytes if output else ring.size_bytes if ring else 0,
            waiting_bytes=self._queue.waiting_bytes,
            malformed=sum(route.malformed for route in routes),
            dropped=sum(route.refused for route in routes),
            paused=self._queue.paused,
            ring_s=ring.span_s() if ring else 0.0,
            missing=_all_missing(output) if output and self._closed else {},
            files=[*self._saved, *([file.path for file in output.files] if output else [])],
        )

    def close(self) -> RecordingReport:
        """Stop listening, write what was received, close the file. Raises `failure` when the disk failed."""
        if not self._closed:
            self._closed = True
            self._tap.close()
            self._queue.put(None)
            self._thread.join()
            self._executor.shutdown()
            self._spinner.join()
            self._node.close()
        if self.failure is not None:
            raise self.failure
        return self.report()

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # -- services --------------------------------------------------------------------------------------------------

    def _serve(self) -> None:
        for name, command in (("pause", self.pause), ("resume", self.resume), ("split", self.split)):
            self._node.create_service(Trigger, f"~/{name}", _answering(command))
        self._node.create_service(Trigger, "~/save", _answering(self.save))
        self._executor.add_node(self._node)
        self._spinner.start()

    # -- the writer's thread ---------------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            self._work()
        except RecordingError as error:
            self.failure = error
        except Exception as error:  # what nobody thought of must not look like a sound recording
            _log.exception("the recording failed")
            self.failure = RecordingError(f"the recording failed: {type(error).__name__}: {error}")
        self.ended.set()
        if self.failure is not None:
            self._drain()

    def _work(self) -> None:
        get, done, clock, options = self._queue.get, self._queue.done, self.context.clock, self._options
        flushed_s = clock.monotonic_s()
        ended = False
        while not ended:
            try:
                item = get(_TICK_S)
            except Empty:
                item = _nothing
            if isinstance(item, Arrival):
                try:
                    data = item.payload.to_bytes()
                    if intact(item.payload):  # else its number is missing, and reported so
                        self._take(item, data)
                finally:
                    done(item)
            elif item is None:
                ended = True
            else:
                item()
            if self.failure is not None:
                raise self.failure
            now_s = clock.monotonic_s()
            if self._output is not None and now_s - flushed_s >= options.chunk_s:
                flushed_s = now_s
                self._output.flush()
        for route in list(self._held):
            self._release(route)
        if self._output is not None:
            tap = getattr(self, "_tap", None)  # none where the recorder could not be made
            self._output.close(_publishers(tap.routes.values()) if tap else ())

    def _drain(self) -> None:
        """After a failure: nothing is written any more; those who wait for an answer get it."""
        self._queue.paused = True
        while True:
            try:
                item = self._queue.get(_TICK_S)
            except Empty:
                continue
            if item is None:
                return
            if isinstance(item, Arrival):
                self._queue.done(item)
            else:
                item()

    def _take(self, arrival: Arrival, payload: bytes) -> None:
        route = arrival.route
        if self._ring is not None:
            self._ring.add(arrival, payload)
        elif self._output is not None and route.schema is not None and route not in self._held:
            self._output.write(arrival, payload)
            self._written += 1
        else:
            self._hold(arrival, payload)

    def _hold(self, arrival: Arrival, payload: bytes) -> None:
        """Until the schema is there; what is over the queue's bound is dropped like what does not fit the queue."""
        if self._held_bytes + len(payload) > self._queue.limit_bytes:
            arrival.route.refused += 1
            arrival.publisher.refuse(arrival.sequence, "dropped")
            return
        self._held_bytes += len(payload) + _HELD_BYTES
        self._held.setdefault(arrival.route, []).append((arrival._replace(payload=None), payload))

    def _release(self, route: Route) -> None:
        """The schema was found, or will not be: write what waited for it."""
        for arrival, payload in self._held.pop(route, ()):
            self._held_bytes -= len(payload) + _HELD_BYTES
            if self._output is not None:
                self._output.write(arrival, payload)
                self._written += 1

    def _when_ready(self, route: Route) -> None:
        """On the schemas' thread."""
        self._queue.put(lambda: self._release(route))

    def _split(self) -> None:
        assert self._output is not None
        try:
            self._output.split()
        except RecordingError as error:
            self.failure = error
            raise

    def _save(self) -> Path:
        if self._ring is None:
            assert self._output is not None
            self._output.flush()
            return self._path
        path = self._free_name()
        output = BagOutput(path, _for_ring(self._options))
        for arrival, payload in self._ring.items():
            output.write(arrival, payload)
        output.close()
        self._saved.append(path)
        self._written += sum(file.messages for file in output.files)
        return path

    def _free_name(self) -> Path:
        """`<folder>/<folder>_<n>.mcap`, the first that is free."""
        folder = self._path.with_suffix("") if self._path.suffix == ".mcap" else self._path
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RecordingError(f"cannot write {folder}: {error.strerror or error}") from None
        for number in range(_NAMES):
            if not (path := folder / f"{folder.name}_{number}.mcap").exists():
                return path
        raise RecordingError(f"{folder} holds {_NAMES} recordings already")

    def _on_writer(self, call: Callable[[], Any]) -> Any:
        """Have the writer's thread do it between two samples; its result or error."""
        if self._closed or self.failure is not None:
            raise self.failure or ClosedError("the recorder was closed")
        ended, results, errors = threading.Event(), [], []

        def run() -> None:
            try:
                if self.failure is not None:
                    raise self.failure
                results.append(call())
            except MetarosError as error:
                errors.append(error)
            finally:
                ended.set()

        self._queue.put(run)
        if not ended.wait(_SAVE_S):
            raise TimeoutError_(f"the recorder's disk did not answer within {_SAVE_S:g} s")
        if errors:
            raise errors[0]
        return results[0]


def _publishers(routes: Iterable[Route]) -> list[Publisher]:
    return [publisher for route in list(routes) for publisher in list(route.publishers.values())]


def _nothing() -> None:
    """Between two samples."""


def _answering(command: Callable[[], object]) -> Callable[[Any, Any], Any]:
    """A Trigger service that says what came of it."""

    def answer(_request: Any, response: Any) -> Any:
        try:
            response.message = str(command() or "")
            response.success = True
        except MetarosError as error:
            response.success, response.message = False, str(error)
        return response

    return answer


def _new_ring(ring: RingOptions) -> Ring:
    if ring.window_s <= 0 or ring.limit_bytes <= 0:
        raise ConfigError("a ring needs a window in seconds and a bound in bytes, both above 0")
    return Ring(window_s=ring.window_s, limit_bytes=ring.limit_bytes)


def _for_ring(options: BagOptions) -> BagOptions:
    return BagOptions(compression=options.compression, chunk_bytes=options.chunk_bytes, continues=False)


def _all_missing(output: BagOutput) -> dict[str, dict[str, int]]:
    """Over all files."""
    found: dict[str, dict[str, int]] = {}
    for file in output.files:
        for topic, reasons in file.missing.items():
            row = found.setdefault(topic, {})
            for reason, count in reasons.items():
                row[reason] = row.get(reason, 0) + count
    return found
