"""The mesh of one store's gateways over Zenoh routers: sealed messages, requests, and notice of peers that come or go.

A gateway is a peer once the two have heard of each other (`gateway.cluster.handshake`). Everything here is the event
loop's, but for `_arrived`, which opens what came on the receiving thread.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import re
import secrets
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from gateway.cluster.errors import PeerBusyError, PeerGoneError, PeerTimeoutError
from gateway.cluster.keys import BOOT_BYTES, MeshKeys, Process
from gateway.cluster.peer import Peer
from gateway.cluster.ports import Answer, PeerListener, Take
from gateway.cluster.requests import LONGEST_S, PendingRequests, RequestServer
from gateway.cluster.seal import ForgedError, sender_of
from gateway.cluster.transport import TIMEOUTS, MeshKeyspace, Timeouts, TokenChange, Transport
from gateway.cluster.wire import MESSAGE_BYTES, Kind, Message
from gateway.identity.master import MasterKey
from metaros.clock import Clock
from metaros.errors import ConfigError, TooLargeError
from metaros.limits import LIMITS, Limits

__all__ = ["MeshCounts", "ZenohMesh"]

log = logging.getLogger(__name__)

TICK_S: Final = 1.0
AT_ONCE: Final = 64  # messages that are handled before others have their turn on the event loop
KNOWN: Final = 4096  # processes whose numbers are kept, so that nothing of theirs comes twice
_NAME: Final = re.compile(r"[A-Za-z0-9._-]{1,64}")


@dataclass(slots=True)
class MeshCounts:
    """Since the gateway started."""

    sent: int = 0  # messages
    sent_bytes: int = 0
    received: int = 0
    received_bytes: int = 0
    asks: int = 0
    dropped: int = 0  # messages that were not sent: too much waited
    refused: int = 0  # frames that no replica of this store sealed for this one, or that came before
    lost: int = 0  # times that messages of a replica's were missing, and it was met anew


class ZenohMesh:
    """`gateway.cluster.ports.Mesh` over Zenoh: register who takes what, `start`, `run` until cancelled, `close`."""

    def __init__(
        self,
        routers: Sequence[str],
        *,
        gateway_id: str,
        store_id: str,
        master: MasterKey,
        clock: Clock,
        limits: Limits = LIMITS,
        patience: Timeouts = TIMEOUTS,
    ) -> None:
        if _NAME.fullmatch(gateway_id) is None:
            raise ConfigError(f"the gateway's id {gateway_id[:64]!r} is not of letters, digits, '.', '_' and '-'")
        self._clock = clock
        self._limits = limits
        boot = (clock.wall_ns() // 1_000_000).to_bytes(6, "big") + secrets.token_bytes(BOOT_BYTES - 6)
        self._own = Process(gateway_id, boot)
        self._keys = MeshKeys(master, store_id)
        self._proof = self._keys.proof(self._own)
        self._keyspace = keyspace = MeshKeyspace(store_id)
        self.counts = MeshCounts()
        self.linked = False  # whether a router is reached
        self._known: dict[bytes, Peer] = {}  # by boot id; those that went, too
        self._met: dict[str, Peer] = {}
        self._takes: dict[str, Take] = {}
        self._listeners: list[PeerListener] = []
        self._requests, self._server = PendingRequests(limits.cluster_asks), RequestServer(limits.cluster_asks)
        self._came: deque[tuple[Peer, Message | None, bool, int] | TokenChange] = deque()
        self._woken = False
        self._strangers: set[str] = set()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._transport = Transport(
            routers,
            inbox=keyspace.inbox(self._own),
            tokens=keyspace.tokens,
            token=keyspace.token(self._own, self._proof),
            arrived=self._arrived,
            most_bytes=limits.cluster_received_bytes,
            patience=patience,
        )

    @property
    def gateway_id(self) -> str:
        """This gateway's own id."""
        return self._own.gateway

    def start(self) -> None:
        """Connect, in the background; gateways are peers as they are met."""
        self._loop = asyncio.get_running_loop()
        self._transport.start()

    async def run(self) -> None:
        """Greet again who has not answered, and follow a change of the master key; until cancelled."""
        while True:
            await asyncio.sleep(TICK_S)
            self.tick()

    def tick(self) -> None:
        """What is to be done every second."""
        self._look()
        for peer in self._known.values():
            self._say(peer, peer.meeting.retry())

    def _look(self) -> bool:
        """Follow a change of the master key, and show a proof by the new one: who starts from now on has no other."""
        if not self._keys.look(now_s=self._clock.monotonic_s()):
            return False
        for peer in self._known.values():
            peer.rekey(self._keys)
        if (proof := self._keys.proof(self._own)) != self._proof:
            self._proof = proof
            self._transport.show(self._keyspace.token(self._own, proof))
        return True

    async def close(self) -> None:
        """Send what waits, and leave; who waits for an answer is told that the others are gone."""
        await self._server.close()
        await asyncio.to_thread(self._transport.close)
        for peer in list(self._met.values()):
            self._became(peer, False)

    def peers(self) -> frozenset[str]:
        """The other gateways that live now."""
        return frozenset(self._met)

    @property
    def queued_bytes(self) -> int:
        """What waits to be sent, to all."""
        return sum(peer.queued_bytes for peer in self._known.values())

    @property
    def waiting_bytes(self) -> int:
        """What came and was not handled yet."""
        return self._transport.waiting_bytes

    @property
    def frames_dropped(self) -> int:
        """Frames that came while too much waited."""
        return self._transport.dropped

    def send(self, gateway: str, topic: str, payload: bytes) -> bool:
        """Send a message to one gateway: those of one topic arrive in order, or not at all when it goes.

        False: there is no such peer, or so much waits for it already that this was not sent.

        Raises:
            TooLargeError: a payload has 17 MiB at most.
        """
        _check(payload)
        peer = self._met.get(gateway)
        return peer is not None and self._post(peer, Kind.TELL, name=topic, payload=bytes(payload))

    def broadcast(self, topic: str, payload: bytes) -> None:
        """Send a message to every peer."""
        for gateway in sorted(self._met):
            self.send(gateway, topic, payload)

    async def request(self, gateway: str, verb: str, payload: bytes, *, timeout_s: float) -> bytes:
        """Have a gateway do something, and get its answer.

        Raises:
            PeerGoneError: it is no peer, or went before it answered.
            PeerTimeoutError: no answer in time; whether it was done is not known.
            PeerBusyError: too much waits for it, or too many questions wait; nothing was sent.
            TooLargeError: the payload is over 17 MiB.
            GatewayError: it answered with this error; see `gateway.cluster.errors`.
        """
        _check(payload)
        peer = self._met.get(gateway)
        if peer is None:
            raise PeerGoneError(f"the replica {gateway} is not there")
        number, answer = self._requests.open(peer.process.boot)
        self.counts.asks += 1
        timeout_ms = round(min(timeout_s, LONGEST_S) * 1000)
        try:
            facts = {"name": verb, "payload": bytes(payload)}
            if not self._post(peer, Kind.ASK, number=number, timeout_ms=timeout_ms, **facts):
                raise PeerBusyError(f"too much waits for the replica {gateway}: try again")
            async with asyncio.timeout(timeout_s):
                return await answer
        except TimeoutError:
            raise PeerTimeoutError(f"the replica {gateway} gave no answer within {timeout_s:g} s") from None
        finally:
            self._requests.drop(number)

    def on_message(self, topic: str, take: Take) -> None:
        """Who takes the messages of a topic."""
        self._takes[topic] = take

    def on_request(self, verb: str, answer: Answer) -> None:
        """Who answers a verb."""
        self._server.on_request(verb, answer)

    def on_peer(self, listener: PeerListener) -> None:
        """Add a listener for gateways that come or go; listeners run in the order of these calls."""
        self._listeners.append(listener)

    def _post(self, peer: Peer, kind: Kind, **facts: object) -> bool:
        meeting = peer.meeting
        message = Message(kind, meeting.mine, meeting.yours, **facts)  # type: ignore[arg-type]
        return self._send(peer, message, bounded=kind is not Kind.REFUSAL)

    def _say(self, peer: Peer, hellos: Sequence[Message]) -> None:
        for hello in hellos:
            self._send(peer, hello, bounded=False)

    def _send(self, peer: Peer, message: Message, *, bounded: bool) -> bool:
        job = peer.sending(message, bounded=bounded)
        if job is None:
            self.counts.dropped += 1
            return False
        self.counts.sent += 1
        self.counts.sent_bytes += len(message.payload)
        self._transport.send(job)
        return True

    def _arrived(self, item: bytes | TokenChange) -> None:
        """On the receiving thread."""
        if isinstance(item, TokenChange):
            self._came.append(item)
        else:
            peer = None
            with contextlib.suppress(ForgedError):
                peer = self._known.get(sender_of(item))
            try:
                if peer is None:
                    raise ForgedError("nobody of that name is known")
                message, missing = peer.taken(item)
            except (ForgedError, ValueError):
                self.counts.refused += 1
                self._transport.done(len(item))
                return
            self._came.append((peer, message, missing, len(item)))
        if not self._woken and self._loop is not None:
            self._woken = True
            with contextlib.suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(self._drain)

    def _drain(self) -> None:
        self._woken = False
        for _ in range(AT_ONCE):
            if not self._came:
                return
            item = self._came.popleft()
            if isinstance(item, TokenChange):
                self._on_live(item)
                continue
            peer, message, missing, size_bytes = item
            self._transport.done(size_bytes)
            self.counts.received_bytes += size_bytes
            if missing:
                self._lost(peer)
            if message is not None:
                self.counts.received += 1
                self._on_message(peer, message)
        if not self._woken and self._loop is not None:
            self._woken = True
            self._loop.call_soon(self._drain)

    def _on_live(self, live: TokenChange) -> None:
        try:
            process = Process(live.gateway, bytes.fromhex(live.boot))
        except ValueError:
            return
        if process == self._own:
            if live.proof == self._proof:
                self._on_router(live.there)
            return
        peer = self._known.get(process.boot)
        if peer is None and live.there:
            peer = self._meet(process, live.proof)
        if peer is not None and peer.process == process and self._is_its(peer, live):
            hellos, became = peer.meeting.token(live.there)
            self._say(peer, hellos)
            if became is not None:
                self._became(peer, became)

    def _is_its(self, peer: Peer, live: TokenChange) -> bool:
        """Whether a token is that process's own: anybody on the routers may declare one like it, and take it back."""
        if live.there and self._proven(peer.process, live.proof):
            peer.proof = live.proof
        return live.proof == peer.proof

    def _proven(self, process: Process, proof: str) -> bool:
        """Also where it has heard of another master key before this gateway."""
        return self._keys.proves(process, proof) or (self._look() and self._keys.proves(process, proof))

    def _on_router(self, there: bool) -> None:
        if there != self.linked:
            self.linked = there
            log.info("the routers of --cluster are %s", "reached" if there else "lost: other replicas are not seen")

    def _meet(self, process: Process, proof: str) -> Peer | None:
        """Begin with a process that nobody here has heard of; None: it is none of ours."""
        if len(process.boot) != BOOT_BYTES or _NAME.fullmatch(process.gateway) is None:
            return None
        if not self._proven(process, proof):
            self._stranger(
                process.gateway, "has another master key, or none: start each replica with the same --master-key"
            )
            return None
        if process.gateway == self.gateway_id:
            if process.boot > self._own.boot:
                self._stranger(process.gateway, "has this one's id: give each replica a data directory of its own")
            return None
        self._forget()
        inbox, most_bytes = self._keyspace.inbox(process), self._limits.cluster_queue_bytes
        peer = Peer(process, self._own, self._keys, inbox=inbox, most_bytes=most_bytes)
        self._known[process.boot] = peer
        return peer

    def _stranger(self, gateway: str, why: str) -> None:
        if gateway not in self._strangers and len(self._strangers) < KNOWN:
            self._strangers.add(gateway)
            log.warning("a gateway %s is on the routers of --cluster that %s; it is no peer", gateway, why)

    def _forget(self) -> None:
        """Make room for one more; who has gone longest yields."""
        if len(self._known) >= KNOWN:
            gone = next((boot for boot, peer in self._known.items() if not peer.meeting.there), None)
            if gone is not None:
                del self._known[gone]

    def _lost(self, peer: Peer) -> None:
        hellos, became = peer.meeting.lost()
        if became is not None:
            self.counts.lost += 1
            self._became(peer, became)
        self._say(peer, hellos)

    def _on_message(self, peer: Peer, message: Message) -> None:
        if message.kind is Kind.HELLO:
            hellos, became = peer.meeting.hello(message)
            self._say(peer, hellos)
            for there in became:
                self._became(peer, there)
        elif self._met.get(peer.gateway) is not peer or not peer.meeting.holds(message):
            return
        elif message.kind is Kind.TELL:
            self._guarded(self._takes.get(message.name), peer.gateway, message.payload)
        elif message.kind is Kind.ASK:
            number = message.number
            self._server.begin(
                peer.gateway, message, lambda kind, payload: self._reply(peer, kind, number=number, payload=payload)
            )
        else:
            self._requests.settle(peer.process.boot, message)

    def _reply(self, peer: Peer, kind: Kind, *, number: int, payload: bytes) -> None:
        if peer.meeting.met and not self._post(peer, kind, number=number, payload=payload):
            log.warning("too much waits for the replica %s: an answer to it is lost", peer.gateway)

    def _became(self, peer: Peer, there: bool) -> None:
        """It is a peer now, or not any more; of two lives of one gateway the newer one counts."""
        current = self._met.get(peer.gateway)
        if there:
            if current is not None and current.process.boot > peer.process.boot:
                return
            if current is not None and current is not peer:
                self._became(current, False)
            self._met[peer.gateway] = peer
        elif current is peer:
            del self._met[peer.gateway]
            self._requests.gone(peer.process.boot, peer.gateway)
        else:
            return
        for listener in self._listeners:
            self._guarded(listener, peer.gateway, there)

    def _guarded(self, handler: Callable[..., None] | None, *args: object) -> None:
        if handler is not None:
            try:
                handler(*args)
            except Exception:
                log.exception("what another replica sent could not be handled")


def _check(payload: bytes) -> None:
    if len(payload) > MESSAGE_BYTES:
        raise TooLargeError(f"{len(payload)} bytes; between replicas {MESSAGE_BYTES} at most")
