"""Talking through a robot over a WebSocket: take, audio packets as binary messages, stop, release; closing it stops."""

from __future__ import annotations

from typing import Any, Final

from fastapi import APIRouter
from starlette.websockets import WebSocket

from gateway.api.authorization import require_permission
from gateway.api.services import services_of
from gateway.api.ws.lease_socket import LeaseSocket, serve
from gateway.api.ws.requests import number_field, text_field
from gateway.errors import InvalidRequestError
from gateway.fleet.talk import CODECS, SAMPLE_RATES, TalkManager

__all__ = ["router"]

ACK_EVERY: Final = 10  # packets: five times a second

router = APIRouter()


@router.websocket("/api/v1/robots/{robot_id}/talk", dependencies=[require_permission("robots.talk")])
async def talk(socket: WebSocket, robot_id: str) -> None:
    """One talker's connection."""
    await serve(socket, _TalkSocket(socket, services_of(socket).talk, robot_id))


class _TalkSocket(LeaseSocket):
    """One talker. Packets after the lease was lost are dropped until it is taken again: they were on their way."""

    def __init__(self, socket: WebSocket, manager: TalkManager, robot_id: str) -> None:
        super().__init__(socket, manager, robot_id)
        self._talk = manager
        self._codec = ""
        self._sample_rate = 0
        self._packets = 0

    def _check_take(self, request: dict[str, Any]) -> None:
        self._codec = text_field(request, "codec")
        self._sample_rate = int(number_field(request, "sample_rate", None, low=1, high=384_000))
        if self._codec not in CODECS or self._sample_rate not in SAMPLE_RATES:
            rates = ", ".join(map(str, SAMPLE_RATES))
            raise InvalidRequestError(f"codec is {' or '.join(CODECS)}, sample_rate one of {rates}")

    async def _use(self, request: dict[str, Any]) -> None:
        raise InvalidRequestError("op is one of take, stop, release; sound comes as binary messages")

    async def _use_bytes(self, data: bytes) -> None:
        if self._drive is None:
            return
        await self._talk.say(self._drive, data, coding=self._codec, sample_rate=self._sample_rate)
        self._packets += 1
        if self._packets % ACK_EVERY == 0:
            await self._say({"op": "ack", "seq": self._packets, "rtt_ms": self._talk.rtt_ms(self._robot)})
