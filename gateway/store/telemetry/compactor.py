"""The compaction thread: finds robots that are due, moves batches into segments, and sweeps aborted uploads."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError, Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from typing import TypeVar

from gateway.errors import DamagedError, ObjectStoreError, PurgedError, StoreError
from gateway.store.engine import StoreEngine
from gateway.store.ledger import sweep_objects
from gateway.store.object_store_marker import check_marker
from gateway.store.objects import ObjectStore
from gateway.store.telemetry.compact import Compaction, CompactPace, Due
from gateway.store.writer import Writer
from metaros.clock import Clock

__all__ = ["Compactor", "take_lease"]

log = logging.getLogger(__name__)
Result = TypeVar("Result")
_LEASE = "compaction"
_WAIT_S = 0.25


class Compactor:
    """Compacts in the background, as long as the writer runs; `error` says why it cannot now."""

    def __init__(
        self,
        writer: Writer,
        connect: Callable[[], StoreEngine],
        objects: ObjectStore,
        *,
        clock: Clock,
        name: str,
        pace: CompactPace | None = None,
        shared: bool = False,
    ) -> None:
        self._writer = writer
        self._connect = connect
        self._objects = objects
        self._clock = clock
        self._name = name
        self._pace = pace if pace is not None else CompactPace()
        self._shared = shared
        self._stopped = threading.Event()
        self._error: str | None = None
        self._last_sweep_s = -1e9
        self._work: Compaction | None = None
        # An object store that hangs must not keep the program from ending.
        self._thread = threading.Thread(target=self._run, name="gateway-compact", daemon=True)

    @property
    def error(self) -> str | None:
        """Why the last attempt failed; None while compaction works."""
        return self._error

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self, *, timeout_s: float = 2.0) -> None:
        """End the thread after the step it is at; what it was at is found again at the next start."""
        self._stopped.set()
        if self._thread.ident is not None:
            self._thread.join(timeout_s)

    def transact(self, job: Callable[[StoreEngine], Result], /) -> Result:
        """Run a job in a transaction on the writer's thread; StoreError when it did not happen, or nobody knows."""
        future: Future[Result] = self._writer.run(job)
        while True:
            try:
                return future.result(timeout=_WAIT_S)
            except FutureTimeoutError:
                if self._stopped.is_set() and future.cancel():
                    raise StoreError("the store is closing") from None
            except CancelledError:
                raise StoreError("the store is closing") from None

    def _run(self) -> None:
        wait_s = 0.0
        engine: StoreEngine | None = None
        while not self._stopped.wait(wait_s):
            try:
                engine = engine if engine is not None else self._connect()
                wait_s = self._cycle(engine)
            except Exception as error:  # whatever it is, batches stay what is stored, and it is tried again
                wait_s = min(self._pace.retry_most_s, max(self._pace.retry_s, 2 * wait_s))
                self._failed(error)
            else:
                if self._error is not None:
                    log.warning("compaction works again")
                self._error = None
        if engine is not None:
            engine.close()

    def _failed(self, error: Exception) -> None:
        if self._stopped.is_set():
            return
        foreseen = isinstance(error, StoreError | ObjectStoreError | DamagedError)
        if self._error is None:
            log.error("compaction failed; messages stay in the database: %s", error, exc_info=not foreseen)
        self._error = str(error) or type(error).__name__

    def _cycle(self, engine: StoreEngine) -> float:
        """Sweep, look, and make one segment of each robot that is due; how long to wait for the next turn."""
        begun_s = self._clock.monotonic_s()
        sweeping = begun_s - self._last_sweep_s >= self._pace.sweep_every_s
        if sweeping:
            check_marker(engine, self.transact, self._objects, clock=self._clock)
        if self._shared and not self.transact(self._lease):
            self._last_sweep_s = begun_s if sweeping else self._last_sweep_s
            return self._pace.look_every_s
        if sweeping:
            sweep_objects(self.transact, self._objects, now_ns=self._clock.wall_ns())
            self._last_sweep_s = begun_s
        if self._work is None:
            self._work = Compaction(engine, self.transact, self._objects, clock=self._clock, pace=self._pace)
        begun_s = self._clock.monotonic_s()
        due = self._work.due()
        look_s = self._clock.monotonic_s() - begun_s
        if due:  # into the directory of ever, not the empty one below a disk that was unmounted a moment ago
            check_marker(engine, self.transact, self._objects, clock=self._clock)
        moved = self._compact(self._work, due)
        # A look at a large backlog costs: no more than a tenth of the time goes into looking.
        return max(0.0 if moved else self._pace.look_every_s, 9 * look_s)

    def _compact(self, work: Compaction, due: Sequence[Due]) -> int:
        """One segment of each, so that no robot waits for another's backlog, nor for what is wrong with it."""
        moved, failed = 0, None
        for one in due:
            try:
                moved += work.compact(one)
            except PurgedError as error:  # retention was faster, or another gateway
                log.debug("a segment was given up: %s", error)
            except StoreError as error:
                failed = error
            if self._stopped.is_set() or (self._shared and not self.transact(self._lease)):
                break
        if failed is not None:
            raise failed
        return moved

    def _lease(self, engine: StoreEngine) -> bool:
        return take_lease(engine, self._name, now_ns=self._clock.wall_ns(), lease_s=self._pace.lease_s)


def take_lease(engine: StoreEngine, name: str, *, now_ns: int, lease_s: float) -> bool:
    """Whether `name` is the one that compacts for the next `lease_s`; inside the caller's writing transaction.

    It saves work, and nothing rests on it: two that compact at once lose no sample and double none.
    """
    engine.execute("INSERT INTO meta VALUES (?, '0 ') ON CONFLICT (key) DO NOTHING", _LEASE)
    find = f"SELECT value FROM meta WHERE key = ?{engine.for_update}"
    until, _, holder = str(engine.fetch(find, _LEASE)[0][0]).partition(" ")
    if holder != name and now_ns < int(until) <= now_ns + 2 * round(lease_s * 1e9):
        return False
    engine.execute("UPDATE meta SET value = ? WHERE key = ?", f"{now_ns + round(lease_s * 1e9)} {name}", _LEASE)
    return True
