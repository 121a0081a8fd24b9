"""Services and actions that clients of the gateway serve in robots' graphs: robots get the list, requests come back.

A robot without a link serves none of it; with the link the list is told anew. What is under way when the link goes is
cancelled here, as nobody could hear its answer.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import logging
from typing import Any, Final

from gateway.errors import CommandTimeoutError, RobotOfflineError, TooManyError
from gateway.fleet.robots import FindRobot, SendFrame, require_online
from gateway.fleet.ros.errors import OfferRefusedError
from gateway.fleet.ros.graph_registry import GraphRegistry
from gateway.fleet.ros.offer import JSON, Answer, Dialect, Execute, Offer, OfferedGoal
from gateway.fleet.ros.typed import catalogue_for
from gateway.fleet.ros.types import full_type_name
from metaros._proto import link_pb2
from metaros.errors import MetarosError
from metaros.idl import names, type_hash
from metaros.limits import LIMITS, Limits

__all__ = ["OfferManager"]

log = logging.getLogger(__name__)
ENDS: Final = {"succeeded": 4, "canceled": 5, "aborted": 6}
Ask = tuple[str, int]  # robot, ask


class OfferManager:
    """`service` and `action` for clients; the rest for the link. All on the event loop."""

    def __init__(self, find: FindRobot, send: SendFrame, graphs: GraphRegistry, *, limits: Limits = LIMITS) -> None:
        self._find = find
        self._send = send
        self._graphs = graphs
        self._limits = limits
        self._numbers = itertools.count(1)
        self._revisions = itertools.count(1)
        self._offers: dict[str, dict[int, Offer]] = {}
        self._tasks: dict[Ask, asyncio.Task[None]] = {}
        self._goals: dict[Ask, OfferedGoal] = {}

    async def service(
        self, robot_id: str, name: str, type_name: str, answer: Answer, *, dialect: Dialect = JSON
    ) -> Offer:
        """Serve `name` in the robot's graph: each request goes to `answer`, in the client's `dialect`.

        Raises:
            OfferRefusedError: the robot cannot have it: somebody serves that name, or it is outside its namespace.
            UnknownTypeError: nobody knows the type.
            RobotOfflineError, CommandTimeoutError: it did not say that it has it.
        """
        return await self._offer(robot_id, name, full_type_name(type_name, "srv"), answer, None, dialect)

    async def action(
        self, robot_id: str, name: str, type_name: str, execute: Execute, *, dialect: Dialect = JSON
    ) -> Offer:
        """Serve the action `name` likewise: `execute(goal)` works on each goal that somebody sends."""
        return await self._offer(robot_id, name, full_type_name(type_name, "action"), None, execute, dialect)

    def of(self, robot_id: str) -> list[Offer]:
        """What is offered on a robot, or to be once it is back."""
        return list(self._offers.get(robot_id, {}).values())

    async def _offer(
        self,
        robot_id: str,
        name: str,
        type_name: str,
        answer: Answer | None,
        execute: Execute | None,
        dialect: Dialect,
    ) -> Offer:
        view = require_online(self._find(robot_id))
        full = names.resolve(name, view.robot.namespace)
        mine = self._offers.setdefault(robot_id, {})
        if len(mine) >= self._limits.offers:
            raise TooManyError(f"robot {robot_id} has {self._limits.offers} offers already")
        if any(one.name == full for one in mine.values()):
            raise OfferRefusedError(f"a client of this gateway serves {full} already")
        catalogue = catalogue_for(self._graphs.of(robot_id), type_name, "")
        hash_text = type_hash(type_name, catalogue)
        offer = Offer(
            robot_id,
            next(self._numbers),
            full,
            type_name,
            hash_text,
            catalogue,
            answer,
            execute,
            self._withdraw,
            dialect,
        )
        mine[offer.number] = offer
        offer.stands = asyncio.get_running_loop().create_future()
        try:
            self._report(robot_id)
            async with asyncio.timeout(self._limits.command_timeout_s):
                state = await offer.stands
        except TimeoutError as error:
            offer.close()
            raise CommandTimeoutError(f"robot {robot_id} does not say that it offers {full}") from error
        except BaseException:
            offer.close()
            raise
        if state.code:
            offer.close()
            raise OfferRefusedError(f"{full}: {state.code}: {state.message}")
        return offer

    def _withdraw(self, offer: Offer) -> None:
        mine = self._offers.get(offer.robot, {})
        if mine.pop(offer.number, None) is None:
            return
        if not mine:
            self._offers.pop(offer.robot, None)
        with contextlib.suppress(RobotOfflineError):
            self._report(offer.robot)

    def _report(self, robot_id: str) -> None:
        message = link_pb2.Offers(revision=next(self._revisions), offers=[one.frame() for one in self.of(robot_id)])
        self._send(robot_id, link_pb2.GatewayFrame(offers=message))

    # -- the link ---------------------------------------------------------------------------------------------------

    def on_online(self, robot_id: str, *, online: bool) -> None:
        """The link came: send the list. Or it went: answers cannot be sent any more."""
        if online and robot_id in self._offers:
            with contextlib.suppress(RobotOfflineError):
                self._report(robot_id)
        if not online:
            for offer in self.of(robot_id):
                if offer.stands is not None and not offer.stands.done():
                    offer.stands.set_exception(RobotOfflineError(f"robot {robot_id} lost its link"))
            for ask, task in list(self._tasks.items()):
                if ask[0] == robot_id:
                    task.cancel()

    def on_states(self, robot_id: str, message: link_pb2.OfferStates) -> None:
        """How the robot stands to what it was told."""
        for state in message.states:
            offer = self._offers.get(robot_id, {}).get(state.number)
            if offer is None:
                continue
            if offer.stands is not None and not offer.stands.done():
                offer.stands.set_result(state)
            elif state.code:  # it was in the graph before; the next link may bring it back
                log.warning("robot %s cannot offer %s any more: %s", robot_id, offer.name, state.message[:200])

    def on_asked(self, robot_id: str, asked: link_pb2.OfferAsked) -> None:
        """Somebody on the robot wants something."""
        key, offer = (robot_id, asked.ask), self._offers.get(robot_id, {}).get(asked.number)
        task, goal = self._tasks.get(key), self._goals.get(key)
        if asked.gone:
            if task is not None:
                task.cancel()
        elif asked.cancel:
            if goal is not None:
                goal.cancel()
        elif task is None and offer is not None:
            if sum(known[0] == robot_id for known in self._tasks) >= self._limits.offer_asks:
                self._refuse(key, f"{self._limits.offer_asks} requests are under way already")
                return
            begun = self._tasks[key] = asyncio.create_task(self._guarded(key, offer, asked))
            begun.add_done_callback(lambda _: (self._tasks.pop(key, None), self._goals.pop(key, None)))
        elif offer is None:
            self._refuse(key, "this offer was taken back")

    async def _guarded(self, key: Ask, offer: Offer, asked: link_pb2.OfferAsked) -> None:
        """Do it, and answer however it goes."""
        work = self._serve if offer.answer is not None else self._execute
        try:
            self._answer(key, await work(key, offer, asked))
        except asyncio.CancelledError:
            self._refuse(key, "its client went away")
        except MetarosError as error:
            self._refuse(key, f"{error.code}: {error}")
        except Exception as error:
            log.exception("an offered service or action")
            self._refuse(key, f"internal: {type(error).__name__}")

    async def _serve(self, key: Ask, offer: Offer, asked: link_pb2.OfferAsked) -> link_pb2.OfferAnswer:
        assert offer.answer is not None
        request = offer.dialect.decode(f"{offer.type_name}_Request", asked.request, offer.catalogue)
        try:
            async with asyncio.timeout(self._limits.offer_answer_s):
                ok, values = await offer.answer(request)
        except TimeoutError:
            return link_pb2.OfferAnswer(ended=True, message=f"no answer within {self._limits.offer_answer_s:g} s")
        if not ok:
            return link_pb2.OfferAnswer(ended=True, message=str(values)[:1024])
        payload = offer.dialect.encode(f"{offer.type_name}_Response", values or {}, offer.catalogue)
        return link_pb2.OfferAnswer(ended=True, ok=True, payload=payload)

    async def _execute(self, key: Ask, offer: Offer, asked: link_pb2.OfferAsked) -> link_pb2.OfferAnswer:
        assert offer.execute is not None

        def feedback(values: Any) -> None:
            payload = offer.dialect.encode(f"{offer.type_name}_Feedback", values, offer.catalogue)
            self._answer(key, link_pb2.OfferAnswer(payload=payload))

        goal = offer.dialect.decode(f"{offer.type_name}_Goal", asked.request, offer.catalogue)
        kept = self._goals[key] = OfferedGoal(asked.goal_id, goal, feedback)
        end, values = await offer.execute(kept)
        payload = offer.dialect.encode(f"{offer.type_name}_Result", values or {}, offer.catalogue)
        return link_pb2.OfferAnswer(ended=True, ok=True, payload=payload, status=ENDS[end])

    def _refuse(self, key: Ask, message: str) -> None:
        self._answer(key, link_pb2.OfferAnswer(ended=True, message=message[:1024], status=ENDS["aborted"]))

    def _answer(self, key: Ask, answer: link_pb2.OfferAnswer) -> None:
        answer.ask = key[1]
        with contextlib.suppress(RobotOfflineError):
            self._send(key[0], link_pb2.GatewayFrame(offer_answer=answer))
