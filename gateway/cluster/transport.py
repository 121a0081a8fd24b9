"""The Zenoh session of the mesh, with one thread that sends and one that decrypts received frames.

Zenoh's own threads only put what came into a queue. The event loop never waits for Zenoh: what it sends waits in a
queue for the sending thread, and what came is handed to it once per batch. Both queues are bounded in bytes; a message
that comes while the receiving one is full is dropped, which the numbers of the next one tell, and the two gateways meet
anew.
"""

from __future__ import annotations

import json
import logging
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from queue import SimpleQueue
from typing import Any, Final

import zenoh

from gateway.cluster.keys import Process

__all__ = ["TIMEOUTS", "MeshKeyspace", "Timeouts", "TokenChange", "Transport"]

log = logging.getLogger(__name__)

_SETTINGS: Final[Mapping[str, object]] = {
    "mode": "client",
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": False,
    "connect/exit_on_failure": True,
    "connect/retry": {"period_init_ms": 100, "period_max_ms": 1000, "period_increase_factor": 2},
}
RETRY_S: Final = 1.0
CLOSE_S: Final = 2.0  # what was to be sent has so long when the gateway ends
Job = Callable[[], Iterator[tuple[str, bytes]]]  # keys and frames to put, made on the sending thread


@dataclass(frozen=True, slots=True, kw_only=True)
class Timeouts:
    """Timeouts for routers and gateways."""

    connect_s: float = 2.0  # for a router, before the others are tried again
    lease_s: float = 3.0  # so that a hung gateway is heard of in seconds


TIMEOUTS: Final = Timeouts()


class MeshKeyspace:
    """The Zenoh key expressions of one store's gateways."""

    def __init__(self, store_id: str) -> None:
        self._root = f"metaros/gateways/{store_id}"

    def token(self, process: Process, proof: str) -> str:
        """The key of its liveliness token."""
        return f"{self._root}/live/{process.gateway}/{process.boot.hex()}/{proof}"

    @property
    def tokens(self) -> str:
        """All of them."""
        return f"{self._root}/live/*/*/*"

    def inbox(self, process: Process) -> str:
        """Where messages for it are put."""
        return f"{self._root}/to/{process.boot.hex()}"


class TokenChange:
    """A liveliness token appeared or disappeared; the key's last three parts name it."""

    __slots__ = ("boot", "gateway", "proof", "there")

    def __init__(self, key: str, there: bool) -> None:
        self.gateway, self.boot, self.proof = key.split("/")[-3:]
        self.there = there


class Transport:
    """Owns session and threads from `start` to `close`; `send` is the event loop's."""

    def __init__(
        self,
        endpoints: Sequence[str],
        *,
        inbox: str,
        tokens: str,
        token: str,
        arrived: Callable[[bytes | TokenChange], None],
        most_bytes: int,
        patience: Timeouts = TIMEOUTS,
    ) -> None:
        """`arrived` is called on the receiving thread; what it took is off the queue when `done` has said so."""
        self._endpoints = tuple(endpoints)
        self._inbox, self._tokens, self._token = inbox, tokens, token
        self._arrived = arrived
        self._most_bytes = most_bytes
        self._patience = patience
        self._lock = threading.Lock()
        self._waiting_bytes = 0
        self.dropped = 0  # frames that came while too much waited
        self._jobs: SimpleQueue[Job | str | None] = SimpleQueue()
        self._came: SimpleQueue[bytes | TokenChange | None] = SimpleQueue()
        self._ended = threading.Event()
        self._threads = [
            threading.Thread(target=self._send, name="cluster-send", daemon=True),
            threading.Thread(target=self._receive, name="cluster-receive", daemon=True),
        ]

    def start(self) -> None:
        """Connect in the background, to whichever router is there, again whenever it goes."""
        for thread in self._threads:
            thread.start()

    def send(self, job: Job) -> None:
        """Put what `job` makes, after what was to be sent before."""
        self._jobs.put(job)

    def show(self, token: str) -> None:
        """Another liveliness token instead: the earlier one is taken back once that is there."""
        self._token = token  # of a session that is yet to come
        self._jobs.put(token)

    def done(self, size_bytes: int) -> None:
        """That much of what came has been dealt with; any thread's."""
        with self._lock:
            self._waiting_bytes -= size_bytes

    @property
    def waiting_bytes(self) -> int:
        """What has come and was not dealt with."""
        return self._waiting_bytes

    def close(self) -> None:
        """Send what is still to be sent, take the token back and leave; blocks for `CLOSE_S` at most."""
        if self._threads[0].ident is None:
            return  # it was never started
        self._jobs.put(None)
        self._threads[0].join(CLOSE_S)
        self._ended.set()
        self._came.put(None)
        self._threads[1].join(CLOSE_S)

    def _send(self) -> None:
        session = self._opened()
        if session is None:
            return
        try:
            # The inbox first: who hears of the token may write at once.
            session.declare_subscriber(self._inbox, zenoh.handlers.Callback(self._on_frame, indirect=False))
            shown = self._token
            token = session.liveliness().declare_token(shown)
            callback = zenoh.handlers.Callback(self._on_token, indirect=False)
            session.liveliness().declare_subscriber(self._tokens, callback, history=True)
            while (job := self._jobs.get()) is not None:
                if not isinstance(job, str):
                    for key, frame in job():
                        session.put(key, frame, congestion_control=zenoh.CongestionControl.BLOCK)
                elif job != shown:
                    earlier, shown, token = token, job, session.liveliness().declare_token(job)
                    earlier.undeclare()
            token.undeclare()
        except zenoh.ZError:
            log.exception("the cluster's session failed; other replicas are not seen until this gateway starts again")
        finally:
            with suppress(zenoh.ZError):
                session.close()

    def _opened(self) -> Any | None:
        """The session, once a router is there; None: it was closed before."""
        config, said = zenoh.Config(), False
        waits = {
            "connect/timeout_ms": round(self._patience.connect_s * 1000),
            "transport/link/tx/lease": round(self._patience.lease_s * 1000),
        }
        for key, value in {**_SETTINGS, **waits, "connect/endpoints": list(self._endpoints)}.items():
            config.insert_json5(key, json.dumps(value))
        while True:
            try:
                return zenoh.open(config)
            except zenoh.ZError as error:
                if not said:
                    said = True
                    where = ", ".join(self._endpoints)
                    log.warning("no router of --cluster answers (%s): %s\nother replicas are not seen", where, error)
            if self._ended.wait(RETRY_S) or self._closing():
                return None

    def _closing(self) -> bool:
        """Whether `close` was called; nothing else is sent before there is a session."""
        return not self._jobs.empty() and self._jobs.get() is None

    def _on_frame(self, sample: zenoh.Sample) -> None:
        frame = sample.payload.to_bytes()
        with self._lock:
            if self._waiting_bytes + len(frame) > self._most_bytes:
                self.dropped += 1
                return
            self._waiting_bytes += len(frame)
        self._came.put(frame)

    def _on_token(self, sample: zenoh.Sample) -> None:
        self._came.put(TokenChange(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT))

    def _receive(self) -> None:
        while (item := self._came.get()) is not None:
            self._arrived(item)
