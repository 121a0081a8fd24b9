"""Driving over a WebSocket: take, drive, stop, release. A closed socket stops the robot and gives the lease back."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter
from starlette.websockets import WebSocket

from gateway.api.authorization import require_permission
from gateway.api.services import services_of
from gateway.api.ws.lease_socket import LeaseSocket, serve
from gateway.api.ws.requests import number_field
from gateway.errors import InvalidRequestError
from gateway.fleet.teleop import TeleopManager

__all__ = ["router"]

MAX_SPEED = 100.0  # m/s and rad/s; what a robot can really do is its base's business
MAX_SEQ = 2.0**53
MAX_STAMP = 2.0**62

router = APIRouter()


@router.websocket("/api/v1/robots/{robot_id}/teleop", dependencies=[require_permission("robots.drive")])
async def teleop(socket: WebSocket, robot_id: str) -> None:
    """One driver's connection."""
    await serve(socket, _TeleopSocket(socket, services_of(socket).teleop, robot_id))


class _TeleopSocket(LeaseSocket):
    """One driver."""

    def __init__(self, socket: WebSocket, manager: TeleopManager, robot_id: str) -> None:
        super().__init__(socket, manager, robot_id)
        self._teleop = manager

    async def _use(self, request: dict[str, Any]) -> None:
        if request.get("op") != "drive":
            raise InvalidRequestError("op is one of take, drive, stop, release")
        linear = number_field(request, "linear", None, low=-MAX_SPEED, high=MAX_SPEED)
        angular = number_field(request, "angular", None, low=-MAX_SPEED, high=MAX_SPEED)
        seq = number_field(request, "seq", 0.0, low=0.0, high=MAX_SEQ)
        sent_ns = number_field(request, "sent_ns", 0.0, low=0.0, high=MAX_STAMP)
        await self._teleop.drive(self._held(), linear=linear, angular=angular, sent_ns=int(sent_ns))
        await self._say({"op": "ack", "seq": int(seq), "rtt_ms": self._teleop.rtt_ms(self._robot)})
