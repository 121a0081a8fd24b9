"""A proxy for an offered service or action: requests go to the gateway as CDR, answers come back from any thread."""

from __future__ import annotations

import threading
from collections.abc import Callable
from queue import Empty
from types import SimpleNamespace
from typing import Any, Final, cast

from metaros._proto import link_pb2
from metaros.cdr import Codec, codec
from metaros.concurrency.waiting import WaitQueue
from metaros.errors import MetarosError, UnknownTypeError
from metaros.idl import message_class
from metaros.idl.known import catalogue_of
from metaros.limits import LIMITS
from metaros.node import Node
from metaros.node.action import ActionServer, ServerGoal
from metaros.node.service import PendingRequest, Responder
from metaros.wire import qos_services

__all__ = ["Asked", "PendingCall", "PendingGoal", "ProxyAction", "ProxyService"]

LOOK_S: Final = 0.05  # how often a goal that nobody says anything of is asked whether it is to stop
CANCELED, SUCCEEDED = 5, 4


class PendingCall:
    """A request that somebody on the robot waits for."""

    goal_id = b""

    def __init__(self, request: bytes, waiting: PendingRequest) -> None:
        self.request = request
        self._waiting = waiting

    def answer(self, answer: link_pb2.OfferAnswer) -> None:
        """What the client made of it."""
        if answer.ok:
            self._waiting.answer(answer.payload)
        else:
            self._waiting.refuse(answer.message)

    def refuse(self, text: str) -> None:
        """Nobody makes anything of it."""
        self._waiting.refuse(text)

    def follow(self, told: Callable[[bool], None]) -> None:
        """A request does not change."""


class PendingGoal:
    """A goal that somebody on the robot sent."""

    def __init__(self, request: bytes, goal_id: bytes) -> None:
        self.request = request
        self.goal_id = goal_id
        self._answers: WaitQueue[link_pb2.OfferAnswer] = WaitQueue()
        self._reported: Callable[[bool], None] = lambda cancel: None
        self._lock = threading.Lock()
        self._stopping = False

    def answer(self, answer: link_pb2.OfferAnswer) -> None:
        """Feedback, or its end."""
        self._answers.put(answer)

    def refuse(self, text: str) -> None:
        """Nobody works on it."""
        self._answers.put(link_pb2.OfferAnswer(ended=True, message=text))

    def follow(self, told: Callable[[bool], None]) -> None:
        """Call `told(cancel)` when it is to stop, from any thread; at once where it is already."""
        with self._lock:
            self._reported, late = told, self._stopping
        if late:
            told(True)

    def stop(self) -> None:
        """Its client is asked to stop. Nothing happens the second time."""
        with self._lock:
            if self._stopping:
                return
            self._stopping, told = True, self._reported
        told(True)

    def next(self) -> link_pb2.OfferAnswer | None:
        """The next answer; None when none came for a moment."""
        try:
            return self._answers.get(LOOK_S)
        except Empty:
            return None


Asked = PendingCall | PendingGoal
Ask = Callable[[Asked], None]


class _Bytes:
    """A codec that leaves CDR as it is."""

    def encode(self, data: Any) -> bytes:
        """See Codec."""
        return bytes(data)

    def decode(self, data: bytes) -> bytes:
        """See Codec."""
        return data


class ProxyService:
    """A service of any type."""

    def __init__(self, node: Node, offer: link_pb2.Offer, ask: Ask) -> None:
        service: Any = SimpleNamespace(__metaros_name__=offer.type_name, __metaros_hash__=offer.type_hash)
        plain = cast("Codec", _Bytes())
        self._responder = Responder(
            node,
            service,
            offer.name,
            lambda request, waiting: ask(PendingCall(request, waiting)),
            request=plain,
            response=plain,
            qos=qos_services,
            backlog=LIMITS.offer_asks,
        )

    def close(self) -> None:
        """Leave the graph; who waits learns that nobody answers."""
        self._responder.close()


class ProxyAction:
    """An action of a type that this agent knows. UnknownTypeError where it does not."""

    def __init__(self, node: Node, offer: link_pb2.Offer, ask: Ask) -> None:
        catalogue = catalogue_of(offer.type_name, offer.type_hash)
        if catalogue is None:
            raise UnknownTypeError(f"the robot does not know the action type {offer.type_name}")
        action = message_class(offer.type_name, catalogue)
        self._ask = ask
        self._goal, self._result, self._feedback = (
            codec(part) for part in (action.Goal, action.Result, action.Feedback)
        )
        self._server = ActionServer(node, action, offer.name, self._execute, cancel=lambda goal: True)

    def close(self) -> None:
        """Leave the graph; goals under way are told to stop."""
        self._server.close()

    def _execute(self, goal: ServerGoal) -> Any:
        """On a worker's thread, until its client ends it."""
        asked = PendingGoal(self._goal.encode(goal.request), goal.goal_id)
        self._ask(asked)
        while True:
            if goal.should_stop:
                asked.stop()
            answer = asked.next()
            if answer is None:
                if self._server.closed:
                    return None
                continue
            if answer.ended:
                return self._end(goal, answer)
            goal.publish_feedback(self._feedback.decode(answer.payload))

    def _end(self, goal: ServerGoal, answer: link_pb2.OfferAnswer) -> Any:
        result = None
        if answer.ok:
            try:
                result = self._result.decode(answer.payload)
            except MetarosError:
                answer.status = 0
        if answer.ok and answer.status == SUCCEEDED:
            goal.succeed(result)
        elif answer.ok and answer.status == CANCELED and goal.is_cancel_requested:
            goal.canceled(result)
        else:
            goal.abort(result)
        return result
