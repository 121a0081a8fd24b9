"""Queries about robots that another gateway evaluates, and this gateway's answers to the others."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import asdict, astuple
from typing import Any, Final, Protocol

from gateway.alerting.watch.database import Database
from gateway.alerting.watch.rows import BandPoint, SeriesWatch
from gateway.domain.finding import Finding
from gateway.errors import GatewayError
from gateway.store.alerting.watch_states import owner_of
from gateway.store.engine import StoreEngine

__all__ = ["ASK_S", "LocalWatch", "RemoteWatch", "answers"]

LEARNING: Final = "watch.learning"
BAND: Final = "watch.band"
NORMAL: Final = "watch.normal"
ASK_S: Final = 15.0  # longer than a lesson waits for its turn
MAX_FINDINGS: Final = 256  # of one lesson
Ask = Callable[[str, str, bytes], Awaitable[bytes]]  # gateway, verb, payload
Answer = Callable[[str, bytes], Awaitable[bytes]]


class LocalWatch(Protocol):
    """What this gateway's own watch answers."""

    async def local_learning(self, robot: str) -> list[SeriesWatch]:
        """How far each series of a robot is learned, by name."""

    def local_band(self, robot: str, series: str, from_ns: int, to_ns: int) -> list[BandPoint]:
        """What a series was and was expected to be, oldest first."""

    async def local_normal(self, findings: Sequence[Finding]) -> list[str]:
        """Teach what was found; what was taught."""


class RemoteWatch:
    """Asks the gateway that evaluates a robot. No answer is an empty one; feedback that none receives is an error."""

    def __init__(self, database: Database, ask: Ask) -> None:
        self._database = database
        self._ask = ask

    async def learning(self, robot: str) -> list[SeriesWatch]:
        """How far each series of a robot is learned, by name."""
        return [SeriesWatch(*row) for row in await self._known(LEARNING, robot, [robot])]

    async def band(self, robot: str, series: str, from_ns: int, to_ns: int) -> list[BandPoint]:
        """What a series was and was expected to be, oldest first."""
        return [BandPoint(*row) for row in await self._known(BAND, robot, [robot, series, from_ns, to_ns])]

    async def normal(self, robot: str, findings: Sequence[Finding]) -> list[str]:
        """Teach what was found; what was taught. GatewayError: nobody was taught, as far as is known."""
        found = await self._asked(NORMAL, robot, [asdict(finding) for finding in findings[:MAX_FINDINGS]])
        return [str(sentence) for sentence in found or [f"nobody judges robot {robot} now: nothing was learned"]]

    async def _known(self, verb: str, robot: str, question: Any) -> list[Any]:
        try:
            return await self._asked(verb, robot, question)
        except GatewayError:
            return []

    async def _asked(self, verb: str, robot: str, question: Any) -> list[Any]:
        def job(engine: StoreEngine) -> str:
            with engine.transaction(write=False):
                return owner_of(engine, robot)

        owner = await self._database.read(job)
        if owner in ("", self._database.gateway_id):  # on its way to another one
            return []
        found: list[Any] = json.loads(await self._ask(owner, verb, json.dumps(question).encode()))
        return found


def answers(here: LocalWatch) -> Mapping[str, Answer]:
    """What other gateways may ask, by verb."""

    async def learning(sender: str, payload: bytes) -> bytes:
        (robot,) = json.loads(payload)
        return _packed(astuple(row) for row in await here.local_learning(str(robot)))

    async def band(sender: str, payload: bytes) -> bytes:
        robot, series, from_ns, to_ns = json.loads(payload)
        return _packed(astuple(row) for row in here.local_band(str(robot), str(series), int(from_ns), int(to_ns)))

    async def normal(sender: str, payload: bytes) -> bytes:
        findings = [Finding(**fields) for fields in json.loads(payload)]
        return _packed(await here.local_normal(findings))

    return {LEARNING: learning, BAND: band, NORMAL: normal}


def _packed(rows: Any) -> bytes:
    return json.dumps(list(rows)).encode()
