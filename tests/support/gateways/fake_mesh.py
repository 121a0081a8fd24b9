"""Gateways that reach each other within one event loop: the API of `gateway.cluster.ports.Mesh` without a network.

meshes = FakeMeshes()
a, b = meshes.join("a"), meshes.join("b")
b.on_message("graph", lambda sender, payload: ...)
a.send("b", "graph", b"...")      # delivered by call_soon, in order
meshes.leave("b")                 # as a kill -9: what is on its way is lost, and a hears that it went
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from gateway.cluster.errors import PeerGoneError, PeerRefusedError, PeerTimeoutError, pack_error, unpack_error
from gateway.cluster.ports import Answer, PeerListener, Take

__all__ = ["FakeMesh", "FakeMeshes"]


class FakeMesh:
    """One gateway of `FakeMeshes`."""

    def __init__(self, meshes: FakeMeshes, gateway_id: str) -> None:
        self.gateway_id = gateway_id
        self.full: set[str] = set()  # gateways whose queue is over its bound: tell gives False
        self._meshes = meshes
        self._takes: dict[str, Take] = {}
        self._answers: dict[str, Answer] = {}
        self._listeners: list[PeerListener] = []
        self._waiting: dict[asyncio.Future[bytes], str] = {}
        self._tasks: set[asyncio.Task[None]] = set()

    def peers(self) -> frozenset[str]:
        """The other gateways that have joined, and not left."""
        return self._meshes.others(self)

    def send(self, gateway: str, topic: str, payload: bytes) -> bool:
        """Deliver soon, in order."""
        peer = self._meshes.peer(self, gateway)
        if peer is None or gateway in self.full:
            return False
        self._meshes.soon(self, peer, lambda: peer.take(topic, self.gateway_id, bytes(payload)))
        return True

    def broadcast(self, topic: str, payload: bytes) -> None:
        """Tell every peer."""
        for gateway in sorted(self.peers()):
            self.send(gateway, topic, payload)

    async def request(self, gateway: str, verb: str, payload: bytes, *, timeout_s: float) -> bytes:
        """The peer's answer, with its errors mapped as the real mesh does it."""
        peer = self._meshes.peer(self, gateway)
        if peer is None:
            raise PeerGoneError(f"the gateway {gateway} is not there")
        answer: asyncio.Future[bytes] = asyncio.get_running_loop().create_future()
        self._waiting[answer] = gateway
        self._meshes.soon(self, peer, lambda: peer.begin(verb, self, bytes(payload), answer))
        try:
            async with asyncio.timeout(timeout_s):
                return await answer
        except TimeoutError:
            raise PeerTimeoutError(f"the gateway {gateway} gave no answer within {timeout_s:g} s") from None
        finally:
            self._waiting.pop(answer, None)

    def on_message(self, topic: str, take: Take) -> None:
        """Who takes the messages of a topic."""
        self._takes[topic] = take

    def on_request(self, verb: str, answer: Answer) -> None:
        """Who answers a verb."""
        self._answers[verb] = answer

    def on_peer(self, listener: PeerListener) -> None:
        """Be told of each gateway that comes or goes."""
        self._listeners.append(listener)

    def take(self, topic: str, sender: str, payload: bytes) -> None:
        """A message has come."""
        if topic in self._takes:
            self._takes[topic](sender, payload)

    def begin(self, verb: str, asker: FakeMesh, payload: bytes, answer: asyncio.Future[bytes]) -> None:
        """A question has come."""
        task = asyncio.get_running_loop().create_task(self._answer(verb, asker, payload, answer))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _answer(self, verb: str, asker: FakeMesh, payload: bytes, answer: asyncio.Future[bytes]) -> None:
        try:
            if verb not in self._answers:
                raise PeerRefusedError("unsupported", f"the gateway {self.gateway_id} knows no {verb!r}")
            result = await self._answers[verb](asker.gateway_id, payload)
        except Exception as error:
            failed = unpack_error(pack_error(error))
            self._meshes.soon(self, asker, lambda: None if answer.done() else answer.set_exception(failed))
        else:
            self._meshes.soon(self, asker, lambda: None if answer.done() else answer.set_result(result))

    def hear(self, gateway: str, there: bool) -> None:
        """A gateway came or went; what was asked of one that went ends."""
        for listener in self._listeners:
            listener(gateway, there)
        if not there:
            for answer in [answer for answer, asked in self._waiting.items() if asked == gateway]:
                if not answer.done():
                    answer.set_exception(PeerGoneError(f"the gateway {gateway} went before it answered"))

    def end(self) -> None:
        """Nothing it has begun goes on."""
        for task in self._tasks:
            task.cancel()


class FakeMeshes:
    """All gateways of one store."""

    def __init__(self) -> None:
        self._joined: dict[str, FakeMesh] = {}

    def join(self, gateway_id: str) -> FakeMesh:
        """A gateway comes: the others hear of it, and it of them, soon."""
        mesh = FakeMesh(self, gateway_id)
        self._joined[gateway_id] = mesh
        loop = asyncio.get_running_loop()
        for other in sorted(self.others(mesh)):
            loop.call_soon(self._hear, other, gateway_id, True)
            loop.call_soon(self._hear, gateway_id, other, True)
        return mesh

    def leave(self, gateway_id: str) -> None:
        """It goes at once, and what is on its way to or from it is lost; the others hear of it soon."""
        self._joined.pop(gateway_id).end()
        for other in sorted(self._joined):
            asyncio.get_running_loop().call_soon(self._hear, other, gateway_id, False)

    def others(self, mesh: FakeMesh) -> frozenset[str]:
        """Whom a gateway sees; nobody once it has left."""
        if self._joined.get(mesh.gateway_id) is not mesh:
            return frozenset()
        return frozenset(self._joined) - {mesh.gateway_id}

    def peer(self, mesh: FakeMesh, gateway: str) -> FakeMesh | None:
        """The gateway of that id, as another one sees it."""
        return self._joined.get(gateway) if gateway in self.others(mesh) else None

    def soon(self, sender: FakeMesh, receiver: FakeMesh, deliver: Callable[[], object]) -> None:
        """Deliver in the loop's next round, where both are there still."""

        def deliver_if_there() -> None:
            if self._joined.get(sender.gateway_id) is sender and self._joined.get(receiver.gateway_id) is receiver:
                deliver()

        asyncio.get_running_loop().call_soon(deliver_if_there)

    def _hear(self, gateway: str, other: str, there: bool) -> None:
        if gateway in self._joined and (other in self._joined) == there:
            self._joined[gateway].hear(other, there)
