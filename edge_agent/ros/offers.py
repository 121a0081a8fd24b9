"""Services and actions that clients of the gateway serve in this robot's graph: offers come down, requests go up.

Without a link nothing is served, as nobody could answer.
Offers live on a node of their own, which is there while there is one, with an executor on a thread of its own.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import logging
import threading
from collections.abc import Callable
from typing import Final

from edge_agent.errors import ScopeError, TakenError
from edge_agent.forwarding.scope import Scope
from edge_agent.link.handler import SendFrame
from edge_agent.ros.proxy_server import Asked, ProxyAction, ProxyService
from metaros._proto import link_pb2
from metaros.errors import MetarosError
from metaros.executor import SingleThreadedExecutor
from metaros.limits import LIMITS, Limits
from metaros.node import Node

__all__ = ["OfferManager"]

LOG = logging.getLogger("metaros.agent.offers")
NODE_NAME: Final = "metaros_clients"
Served = ProxyService | ProxyAction


class OfferManager:
    """All on the event loop; what is served calls from the executor's thread."""

    def __init__(self, node: Node, scope: Scope, *, limits: Limits = LIMITS) -> None:
        self._agent = node
        self._scope = scope
        self._limits = limits
        self._loop = asyncio.get_running_loop()
        self._send_frame: SendFrame | None = None
        self._serving: dict[int, Served] = {}
        self._asks = itertools.count(1)
        self._open: dict[int, Asked] = {}
        self._node: Node | None = None
        self._executor: SingleThreadedExecutor | None = None
        self._thread: threading.Thread | None = None
        self._work: asyncio.Task[None] | None = None
        self._wanted: link_pb2.Offers | None = None
        self._came = asyncio.Event()
        self._lock = threading.Lock()  # one list at a time

    def link(self, send: SendFrame | None) -> None:
        """Another link, or none: then nothing is offered any more, as nobody could answer."""
        self._send_frame = send
        if send is not None:
            return
        for asked in list(self._open.values()):
            asked.refuse("the robot lost its link to the gateway")
        self._open.clear()
        self._want(link_pb2.Offers())

    def take(self, frame: link_pb2.GatewayFrame) -> None:
        """The whole list, or an answer."""
        if frame.HasField("offers"):
            self._want(frame.offers)
            return
        answer = frame.offer_answer
        asked = self._open.get(answer.ask)
        if asked is not None:
            if answer.ended:
                del self._open[answer.ask]
            asked.answer(answer)

    async def run(self) -> None:
        """Bring what is served in line with what is wanted, one list after the other; until cancelled."""
        try:
            while True:
                await self._came.wait()
                self._came.clear()
                wanted, to = self._wanted or link_pb2.Offers(), self._send_frame
                states = await asyncio.to_thread(self._reconcile, list(wanted.offers))
                if to is not None and to is self._send_frame and states:
                    to(link_pb2.AgentFrame(offer_states=link_pb2.OfferStates(states=states)))
        finally:
            self.link(None)
            self._reconcile([])

    def _want(self, offers: link_pb2.Offers) -> None:
        self._wanted = offers
        self._came.set()

    def _reconcile(self, wanted: list[link_pb2.Offer]) -> list[link_pb2.OfferState]:
        """In a thread: declaring takes its time. How the new ones stand."""
        with self._lock:
            return self._serve_all(wanted)

    def _serve_all(self, wanted: list[link_pb2.Offer]) -> list[link_pb2.OfferState]:
        by_number = {offer.number: offer for offer in wanted[: self._limits.offers]}
        for number in [known for known in self._serving if known not in by_number]:
            self._serving.pop(number).close()
        states = []
        for number, offer in by_number.items():
            if number in self._serving:
                continue
            state = link_pb2.OfferState(number=number)
            try:
                self._serving[number] = self._serve(offer)
            except MetarosError as error:
                state.code, state.message = error.code, str(error)[:1024]
            states.append(state)
        if not self._serving:
            self._leave()
        return states

    def _serve(self, offer: link_pb2.Offer) -> Served:
        if not self._scope.includes(offer.name):
            raise ScopeError(f"{offer.name} is outside the agent's namespace {self._scope.namespace}")
        taken = f"{offer.name}/_action/send_goal" if offer.action else offer.name
        if self._agent.graph.endpoints(taken, "SS"):
            raise TakenError(f"somebody serves {offer.name} already")
        node = self._home()
        ask = self._asker(offer.number)
        return ProxyAction(node, offer, ask) if offer.action else ProxyService(node, offer, ask)

    def _asker(self, number: int) -> Callable[[Asked], None]:
        def ask(asked: Asked) -> None:
            with contextlib.suppress(RuntimeError):  # the loop is closed: the program ends
                self._loop.call_soon_threadsafe(self._asked, number, asked)

        return ask

    def _asked(self, number: int, asked: Asked) -> None:
        """On the loop: somebody wants something."""
        if self._send_frame is None or len(self._open) >= self._limits.offer_asks:
            asked.refuse("nobody can be asked now")
            return
        ask = next(self._asks)
        self._open[ask] = asked
        frame = link_pb2.OfferAsked(number=number, ask=ask, request=asked.request, goal_id=asked.goal_id)
        self._send_frame(link_pb2.AgentFrame(asked=frame))

        def told(cancel: bool) -> None:
            with contextlib.suppress(RuntimeError):
                self._loop.call_soon_threadsafe(self._changed, ask, cancel)

        asked.follow(told)

    def _changed(self, ask: int, cancel: bool) -> None:
        """On the loop: a goal is to stop."""
        if ask in self._open and self._send_frame is not None:
            self._send_frame(link_pb2.AgentFrame(asked=link_pb2.OfferAsked(ask=ask, cancel=cancel)))

    def _home(self) -> Node:
        """The node of what is offered, with its thread."""
        if self._node is None:
            agent = self._agent
            self._node = Node(NODE_NAME, namespace=agent.namespace, context=agent.context, enable_rosout=False)
            self._executor = SingleThreadedExecutor()
            self._executor.add_node(self._node)
            self._thread = threading.Thread(target=self._executor.spin, name=NODE_NAME, daemon=True)
            self._thread.start()
        return self._node

    def _leave(self) -> None:
        if self._node is not None and self._executor is not None and self._thread is not None:
            self._executor.shutdown()
            self._thread.join()
            self._node.close()
            self._node = self._executor = self._thread = None
