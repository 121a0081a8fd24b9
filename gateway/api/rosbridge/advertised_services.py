"""Services and actions that a client serves in a robot's graph: calls from the robot are answered by the client."""

from __future__ import annotations

import asyncio
from itertools import count
from typing import Any

from gateway.api.rosbridge.client import Client
from gateway.api.rosbridge.dialect import decode, encode
from gateway.api.rosbridge.requests import ActionFeedback, ActionResult, Offer, ServiceResponse, Unoffer
from gateway.errors import InvalidRequestError, TooManyError
from gateway.fleet.ros import offer as offers
from metaros.idl import Catalogue
from metaros.limits import LIMITS

__all__ = ["AdvertisedServices"]

ANSWER_S = 120.0  # a client that says nothing for so long has failed the call
ENDS: dict[int, offers.GoalEnd] = {4: "succeeded", 5: "canceled"}


class AdvertisedServices:
    """Of one client. Its offers end with its socket."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._numbers = count(1)
        self._offers: dict[tuple[str, str], offers.Offer | None] = {}  # ("service", its name); None: being made
        self._asked: dict[str, asyncio.Future[ServiceResponse]] = {}
        self._working: dict[str, tuple[offers.OfferedGoal, asyncio.Future[ActionResult]]] = {}

    def advertise(self, request: Offer) -> None:
        """Offer a service or an action; what the robot says against it comes as a status."""
        kind = "action" if request.op == "advertise_action" else "service"
        key = (kind, request.name)
        if key in self._offers:
            raise InvalidRequestError(f"you serve {request.name} already")
        if len(self._offers) >= LIMITS.subscriptions_per_viewer:
            raise TooManyError(f"a client serves at most {LIMITS.subscriptions_per_viewer} names")
        self._client.spawn(self._advertise(key, request), request.id)
        self._offers[key] = None

    def unadvertise(self, request: Unoffer) -> None:
        """Take it back."""
        key = ("action" if request.op == "unadvertise_action" else "service", request.name)
        if key not in self._offers:
            raise InvalidRequestError(f"you do not serve {request.name}")
        offer = self._offers.pop(key)
        if offer is not None:
            offer.close()

    def on_response(self, request: ServiceResponse) -> None:
        """The client answers a call."""
        asked = self._asked.get(request.id or "")
        if asked is None or asked.done():
            raise InvalidRequestError(f"no call of id {request.id!r} waits for an answer")
        asked.set_result(request)

    def on_feedback(self, request: ActionFeedback) -> None:
        """The client tells how far a goal is; FieldError when that does not fit its type."""
        self._goal(request.id)[0].feedback(request.values if request.values is not None else {})

    def on_result(self, request: ActionResult) -> None:
        """The client is through with a goal."""
        result = self._goal(request.id)[1]
        if not result.done():
            result.set_result(request)

    def close(self) -> None:
        """Its socket is over."""
        made, self._offers = list(self._offers.values()), {}
        for offer in made:
            if offer is not None:
                offer.close()
        for asked in self._asked.values():
            asked.cancel()
        for _, result in self._working.values():
            result.cancel()

    def _goal(self, name: str | None) -> tuple[offers.OfferedGoal, asyncio.Future[ActionResult]]:
        working = self._working.get(name or "")
        if working is None:
            raise InvalidRequestError(f"you have no goal of id {name!r}")
        return working

    async def _advertise(self, key: tuple[str, str], request: Offer) -> None:
        access, name, made = self._client.access, request.name, None
        spoken = offers.Dialect(self._encode, decode)
        try:
            if key[0] == "service":
                made = await access.offer_service(name, request.type_name, self._answering(name), dialect=spoken)
            else:
                made = await access.offer_action(name, request.type_name, self._executing(name), dialect=spoken)
        finally:
            if made is None:
                self._offers.pop(key, None)
        if key in self._offers:
            self._offers[key] = made
        else:  # taken back meanwhile
            made.close()

    def _encode(self, name: str, value: Any, catalogue: Catalogue) -> bytes:
        return encode(name, value, catalogue, now_ns=self._client.now_ns)

    def _answering(self, name: str) -> offers.Answer:
        async def answer(asked: Any) -> tuple[bool, Any]:
            number = f"service_request:{name}:{next(self._numbers)}"
            answered = self._asked[number] = asyncio.get_running_loop().create_future()
            try:
                self._client.say({"op": "call_service", "id": number, "service": name, "args": asked})
                async with asyncio.timeout(ANSWER_S):
                    response = await answered
            except TimeoutError:
                return False, f"the client that serves {name} gave no answer within {ANSWER_S:g} s"
            finally:
                del self._asked[number]
            if response.result:
                return True, response.values if isinstance(response.values, dict) else {}
            return False, str(response.values or f"the client that serves {name} failed")

        return answer

    def _executing(self, name: str) -> offers.Execute:
        async def execute(goal: offers.OfferedGoal) -> tuple[offers.GoalEnd, Any]:
            number = f"action_goal:{name}:{goal.id}"
            result: asyncio.Future[ActionResult] = asyncio.get_running_loop().create_future()
            self._working[number] = goal, result
            asked = {"op": "send_action_goal", "id": number, "action": name, "args": goal.goal, "feedback": True}
            cancelling = asyncio.create_task(self._pass_cancel(goal, number, name))
            try:
                self._client.say(asked)
                ended = await result
            finally:
                cancelling.cancel()
                del self._working[number]
            values = ended.values if isinstance(ended.values, dict) else {}
            return ENDS.get(ended.status, "aborted") if ended.result or ended.status == 5 else "aborted", values

        return execute

    async def _pass_cancel(self, goal: offers.OfferedGoal, number: str, name: str) -> None:
        await goal.cancelled()
        self._client.say({"op": "cancel_action_goal", "id": number, "action": name})
