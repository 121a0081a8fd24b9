"""Merges the services that clients of several gateways offer in one robot's graph, and routes its requests back.

A robot knows one list and one numbering. Here each gateway's numbers become the robot's and back.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

from metaros._proto import link_pb2
from metaros.limits import LIMITS, Limits

__all__ = ["OfferMerge"]


@dataclass(slots=True)
class _Robot:
    """One robot's list."""

    offers: dict[str, dict[int, link_pb2.Offer]] = field(default_factory=dict)  # gateway -> its number -> the offer
    numbers: dict[tuple[str, int], int] = field(default_factory=dict)  # gateway and its number -> the robot's
    asks: dict[int, str] = field(default_factory=dict)  # that wait for their ends, and at which gateway


class OfferMerge:
    """Of robots whose links are here. Pure; a robot's asks are bounded by its agent."""

    def __init__(self, *, limits: Limits = LIMITS) -> None:
        self._limits = limits
        self._robots: dict[str, _Robot] = {}
        self._numbers = itertools.count(1)
        self._revisions = itertools.count(1)

    def put(self, robot: str, gateway: str, message: link_pb2.Offers) -> link_pb2.OfferStates | None:
        """A gateway's whole list; returns refusals of offers for which the robot has no room."""
        one = self._robots.setdefault(robot, _Robot())
        others = sum(len(mine) for other, mine in one.offers.items() if other != gateway)
        room = max(0, self._limits.offers - others)
        one.offers[gateway] = {offer.number: offer for offer in message.offers[:room]}
        gone = [key for key in one.numbers if key[0] == gateway and key[1] not in one.offers[gateway]]
        for key in gone:
            del one.numbers[key]
        for number in one.offers[gateway]:
            if (gateway, number) not in one.numbers:
                one.numbers[gateway, number] = next(self._numbers)
        text = f"robot {robot} has {self._limits.offers} offers already"
        refused = [
            link_pb2.OfferState(number=offer.number, code="too_many", message=text) for offer in message.offers[room:]
        ]
        return link_pb2.OfferStates(states=refused) if refused else None

    def list_of(self, robot: str) -> link_pb2.Offers:
        """The robot's list."""
        offers = link_pb2.Offers(revision=next(self._revisions))
        one = self._robots.get(robot, _Robot())
        for (gateway, number), known in one.numbers.items():
            offers.offers.add().CopyFrom(one.offers[gateway][number])
            offers.offers[-1].number = known
        return offers

    def forget(self, robot: str) -> None:
        """Its link is gone: the gateways tell their lists anew when there is another one."""
        self._robots.pop(robot, None)

    def drop(self, gateway: str) -> dict[str, list[int]]:
        """A gateway went: the robots whose lists are others now, with the asks that nobody answers any more."""
        changed: dict[str, list[int]] = {}
        for robot, one in self._robots.items():
            if one.offers.pop(gateway, None):
                one.numbers = {key: number for key, number in one.numbers.items() if key[0] != gateway}
                changed[robot] = [ask for ask, asked in one.asks.items() if asked == gateway]
                one.asks = {ask: asked for ask, asked in one.asks.items() if asked != gateway}
        return changed

    def states(self, robot: str, message: link_pb2.OfferStates) -> dict[str, link_pb2.OfferStates]:
        """What the robot says of its list, by gateway and in its numbers."""
        one, found = self._robots.get(robot, _Robot()), dict[str, link_pb2.OfferStates]()
        owners = {known: key for key, known in one.numbers.items()}
        for state in message.states:
            if state.number in owners:
                gateway, number = owners[state.number]
                mine = found.setdefault(gateway, link_pb2.OfferStates()).states.add()
                mine.CopyFrom(state)
                mine.number = number
        return found

    def asked(self, robot: str, asked: link_pb2.OfferAsked) -> str:
        """The gateway whose client is asked, "" when there is none; the number becomes that gateway's."""
        one = self._robots.get(robot, _Robot())
        if asked.gone:
            return one.asks.pop(asked.ask, "")
        if asked.cancel:
            return one.asks.get(asked.ask, "")
        for (gateway, number), known in one.numbers.items():
            if known == asked.number:
                one.asks[asked.ask], asked.number = gateway, number
                return gateway
        return ""

    def answered(self, robot: str, gateway: str, answer: link_pb2.OfferAnswer) -> bool:
        """Whether that gateway was asked, so that its answer goes to the robot."""
        asks = self._robots.get(robot, _Robot()).asks
        if asks.get(answer.ask) != gateway:
            return False
        if answer.ended:
            del asks[answer.ask]
        return True
