"""The bridge between the hub and the ROS graph: one thread that owns all of it, so that nothing needs a lock."""

from __future__ import annotations

import logging
import threading
from collections.abc import Sequence
from typing import Final

import zmq

from metaros.broker.demand import Demand
from metaros.broker.faults import Faults
from metaros.broker.frames import join
from metaros.broker.hub import Hub, HubTotals
from metaros.broker.incoming import Incoming
from metaros.broker.outgoing import Outgoing
from metaros.broker.report import BrokerReport
from metaros.broker.type_inference import TypeTable
from metaros.broker.types import Types
from metaros.broker.unheard import Unheard
from metaros.broker.wakeup_socket import WakeupSocket
from metaros.idl.globs import Glob
from metaros.node import Node

__all__ = ["Bridge"]

_log = logging.getLogger("metaros.broker")
_TICK_S: Final = 0.25
_SLICE_S: Final = 0.004  # of converting in each direction before the sockets have their turn
_DRAIN: Final = 1000  # messages taken from the hub at a time


class Bridge:
    """Runs from its making until `close`."""

    def __init__(
        self, hub: Hub, node: Node, *, table: TypeTable, only: Sequence[Glob], two_frames: bool, strict: bool
    ) -> None:
        self._hub = hub
        self._node = node
        self._two_frames = two_frames
        self._demand = Demand()
        self._wakeup = WakeupSocket()
        self._stopped = False
        self._graph_changed = True
        self._totals = HubTotals()
        self._missed = 0
        self._unseen_frames = self._unseen_bytes = 0  # that are accounted for
        self._unheard = Unheard(ignore=hub.ignore, heed=hub.heed)
        self._next_tick_s = 0.0
        self._version = -1  # of the demand that was acted on
        faults = Faults(node)
        self._types = Types(node, changed=self._on_graph, faults=faults)
        self._incoming = Incoming(
            node, table=table, types=self._types, only=only, faults=faults, heard=self._wakeup.wake
        )
        self._outgoing = Outgoing(
            node,
            self._demand,
            types=self._types,
            only=only,
            strict=strict,
            is_own=self._incoming.is_own,
            send=self._send,
            wake=self._wakeup.wake,
            faults=faults,
        )
        self._forget_graph = node.graph.on_change(self._on_graph)
        self._thread = threading.Thread(target=self._run, name="metaros-zmq-bridge", daemon=True)
        self._thread.start()

    def report(self) -> BrokerReport:
        """What went through since the beginning."""
        rows = [*self._incoming.rows(), *self._outgoing.rows()]
        return BrokerReport(
            rows=tuple(sorted(rows, key=lambda row: (row.topic, row.direction))),
            hub_frames=self._totals.frames,
            hub_bytes=self._totals.bytes,
            hub_missed=self._missed,
            unreadable=self._incoming.unreadable + self._odd_messages(self._totals),
            subscriptions=tuple(prefix.decode(errors="backslashreplace") for prefix in self._demand.prefixes),
        )

    def close(self) -> None:
        """End the thread; the hub's sockets are free then."""
        self._stopped = True
        self._wakeup.wake()
        self._thread.join()
        self._forget_graph()
        self._types.close()
        self._outgoing.close()
        self._incoming.close()
        self._wakeup.close()

    def _on_graph(self) -> None:
        self._graph_changed = True
        self._wakeup.wake()

    def _send(self, topic: bytes, payload: bytes) -> None:
        self._hub.outbound.send_multipart(join(topic, payload, two_frames=self._two_frames))

    def _run(self) -> None:
        poller = zmq.Poller()
        for source in (self._hub.received, self._hub.outbound, self._hub.control, self._wakeup.fileno()):
            poller.register(source, zmq.POLLIN)
        pause, more = threading.Event(), False
        while not self._stopped:
            poller.poll(0 if more else int(_TICK_S * 1000))
            self._wakeup.clear()
            try:
                more = self._step()
            except Exception:  # a fault of ours must not end the bridge
                if not self._stopped:
                    _log.exception("the bridge stumbled")
                    pause.wait(_TICK_S)

    def _step(self) -> bool:
        """Everything that is to be done now; whether more waits."""
        now_s = self._node.clock.monotonic_s()
        self._read_subscriptions(now_s)
        if now_s >= self._next_tick_s:
            self._next_tick_s = now_s + _TICK_S
            self._demand.sweep(now_s=now_s)
            self._unheard.look(self._incoming.routes, now_s=now_s)
            self._hub.ask_totals()
        self._unheard.listen()
        if self._graph_changed:
            self._graph_changed = False
            self._version = -1
            self._incoming.refresh()
            self._outgoing.look()
        if self._version != self._demand.version:
            self._version = self._demand.version
            self._outgoing.refresh()
        more = self._drain()
        more |= self._incoming.work(_SLICE_S)
        more |= self._outgoing.work(_SLICE_S)
        return more

    def _read_subscriptions(self, now_s: float) -> None:
        try:
            while True:
                (frame, *_) = self._hub.outbound.recv_multipart(zmq.NOBLOCK)
                if frame[:1] == b"\x01":
                    self._demand.subscribe(frame[1:])
                elif frame[:1] == b"\x00":
                    self._demand.unsubscribe(frame[1:], now_s=now_s)
        except zmq.Again:
            pass

    def _drain(self) -> bool:
        """Take what the hub has for us; whether more may wait."""
        totals = self._hub.read_totals()
        receive, take = self._hub.received.recv_multipart, self._incoming.take
        try:
            for _ in range(_DRAIN):
                take(receive(zmq.NOBLOCK))
        except zmq.Again:
            if totals is not self._totals:
                self._totals = totals
                self._account_for_unseen(totals)
            return False
        return True

    def _account_for_unseen(self, totals: HubTotals) -> None:
        """What the hub had forwarded by then and did not come here: topics left out, else what was too fast for us."""
        frames = totals.frames - self._incoming.frames - self._odd_messages(totals) - self._unseen_frames
        size_bytes = totals.bytes - self._incoming.bytes - self._unseen_bytes
        if frames > 0:
            self._unseen_frames += frames
            self._unseen_bytes += size_bytes
        if not self._unheard.credit(max(0, frames), max(0, size_bytes)):
            self._missed += max(0, frames)

    def _odd_messages(self, totals: HubTotals) -> int:
        """Of the frames that looked like subscriptions: how many were none."""
        return max(0, self._incoming.odd - totals.subscriptions)
