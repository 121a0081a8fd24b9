"""`/foxglove` and `/foxglove/ROBOT`, which is also `/` and `/ROBOT` on Foxglove's own port: the socket itself."""

from __future__ import annotations

import asyncio
from importlib.metadata import version

from fastapi import APIRouter
from starlette.responses import PlainTextResponse
from starlette.websockets import WebSocket, WebSocketDisconnect

from gateway.api.authorization import require_permission
from gateway.api.foxglove.session import Session
from gateway.api.foxglove.texts import ERROR, status
from gateway.api.open_connections import REVOKED, OpenConnection
from gateway.api.robot_access import RobotAccess
from gateway.api.services import Services, services_of
from gateway.api.ws.close import STALLED, TOO_MUCH, close_socket, set_close_notice
from gateway.api.ws.send_queue import SendQueue
from gateway.api.ws.writer import take_messages
from gateway.errors import TooManyRequestsError
from metaros.limits import LIMITS

__all__ = ["PROTOCOLS", "router"]

PROTOCOLS = (
    "foxglove.sdk.v1",
    "foxglove.websocket.v1",
)  # the same on the wire; the first that a client offers of these
HOLDER_CHARS = 64
SPANNED = 64  # robots that are asked since when they have history
HELP = (
    "This is a Foxglove WebSocket server. A client offers the subprotocol foxglove.sdk.v1 or foxglove.websocket.v1; "
    "this one offered {offered}.\n"
)

router = APIRouter()


@router.websocket("/foxglove", dependencies=[require_permission("telemetry.read")])
async def foxglove_fleet(socket: WebSocket) -> None:
    """A client of all robots that it sees, or of the one that `?robot=` names."""
    await _serve(socket, socket.query_params.get("robot") or None)


@router.websocket("/foxglove/{robot_id}", dependencies=[require_permission("telemetry.read")])
async def foxglove_robot(socket: WebSocket, robot_id: str) -> None:
    """A client of one robot, which sees its ROS names as they are."""
    await _serve(socket, robot_id)


async def _serve(socket: WebSocket, robot: str | None) -> None:
    services = services_of(socket)
    offered = socket.scope.get("subprotocols", ())
    chosen = next((name for name in PROTOCOLS if name in offered), None)
    if chosen is None:
        said = ", ".join(offered)[:200] or "none"
        await socket.send_denial_response(PlainTextResponse(HELP.format(offered=said), 400))
        return
    with services.open_connections.track(socket) as connection:
        if services.open_connections.viewers_full(connection.principal):
            await socket.send_denial_response(PlainTextResponse("too_many: too many viewers are connected\n", 429))
            return
        with services.open_connections.count_viewer(connection.principal):
            await _admit(socket, connection, robot, chosen)


async def _admit(socket: WebSocket, connection: OpenConnection, robot: str | None, protocol: str) -> None:
    """One client that has its place, until either side ends it."""
    services = services_of(socket)
    access = RobotAccess.of(socket, services, connection, robot=robot)
    span_ns = await _span_ns(services, access) if socket.query_params.get("history") != "off" else None
    await socket.accept(protocol)
    set_close_notice(socket, status(ERROR, f"{TOO_MUCH} ({TooManyRequestsError.code})"))
    if access.may("robots.publish"):
        take_messages(socket, LIMITS.json_bytes)
    send_queue = SendQueue(socket, clock=services.clock, stall_s=services.settings.viewer_stall_s)
    asked = socket.query_params
    holder = asked.get("drive", "")[:HOLDER_CHARS]
    session = Session(access, send_queue, span_ns=span_ns, lease_id=asked.get("lease", ""), holder=holder)
    await _run(socket, connection, send_queue, session, robot)


async def _run(
    socket: WebSocket, connection: OpenConnection, send_queue: SendQueue, session: Session, robot: str | None
) -> None:
    """Until either side ends it."""
    services = services_of(socket)
    name = f"Meta-ROS {robot or 'fleet'}"
    metadata = {"metaros": version("metaros"), **({"robot": robot} if robot else {})}
    reading = asyncio.create_task(_read(socket, session))
    telling = asyncio.create_task(session.run(name=name, session=services.store.gateway_id, metadata=metadata))
    over, stalled = asyncio.create_task(connection.revoked.wait()), asyncio.create_task(send_queue.stalled())
    tasks = (reading, telling, over, stalled)
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        if over in done:
            await close_socket(socket, REVOKED, "bad_credentials")
        elif stalled in done:
            await close_socket(socket, STALLED, "stalled")
        for task in done:
            task.result()
    except (WebSocketDisconnect, RuntimeError):
        return
    finally:
        send_queue.close()
        await asyncio.shield(session.close())
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def _read(socket: WebSocket, session: Session) -> None:
    while True:
        message = await socket.receive()
        if message["type"] == "websocket.disconnect":
            return
        session.handle(message)


async def _span_ns(services: Services, access: RobotAccess) -> tuple[int, int] | None:
    """From when to when there is history of what the client sees; None: there is none, or it may not be played."""
    if not access.may("history.read"):
        return None
    first_ns = 0
    for record in access.robots()[:SPANNED]:
        stored = await services.store.stored_topics(record.robot.id)
        starts = [item.first_ns for item in stored if item.first_ns > 0]
        first_ns = min([first_ns, *starts]) if first_ns else min(starts, default=0)
    return (first_ns, services.clock.wall_ns()) if first_ns else None
