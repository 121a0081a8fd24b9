"""Serving one lane, whatever carries it: Hello, then a reader and a writer until either ends."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable

from gateway.domain.identity import Peer
from gateway.errors import LinkBusyError, LinkError, ProtocolError
from gateway.ingest.links import Lane, Links
from metaros._proto import link_pb2

__all__ = ["LaneGoneError", "serve_lane"]

log = logging.getLogger(__name__)

HELLO_S = 10.0
GOODBYE_S = 1.0  # how long a closed lane may take to write its Goodbye

Read = Callable[[], Awaitable[link_pb2.AgentFrame | None]]
Write = Callable[[link_pb2.GatewayFrame], Awaitable[None]]


class LaneGoneError(LinkError):
    """The connection ended under a frame that was being written: nobody is left to be told anything."""


async def serve_lane(links: Links, read: Read, write: Write, *, peer: Peer) -> bool:
    """Run a lane from its Hello to its end. `read` gives None once the connection is over, `write` LaneGoneError.

    False when the agent took not even the last words: the connection has to be cut.
    """
    try:
        with links.lane_limits.opening(peer):
            async with asyncio.timeout(HELLO_S):
                first = await read()
                if first is None:
                    return True
                if first.WhichOneof("frame") != "hello":
                    raise ProtocolError("the first frame of a lane is its Hello")
                links.check(first.hello)
                admitted = await links.authenticator.admit(
                    first.hello, peer, lambda challenge: _ask(challenge, read, write)
                )
            links.lane_limits.admitted(admitted.robot)
            lane = await links.join(first.hello, admitted)
    except LaneGoneError as error:  # whoever comes and goes fills no log
        log.debug("a lane ended before it was open: %s", error)
        return True
    except LinkError as error:
        if not isinstance(error, LinkBusyError):  # whoever floods fills no log
            log.warning("a link was refused: %s", error)
        goodbye = link_pb2.Goodbye(code=error.code, message=str(error)[:1024], retry_after_ms=error.retry_after_ms)
        return await _in_time(write(link_pb2.GatewayFrame(goodbye=goodbye)))
    except TimeoutError:
        return False
    reader = asyncio.create_task(_read(links, lane, read))
    writer = asyncio.create_task(_write(lane, write))
    over = asyncio.create_task(lane.outbox.closed())
    for task in (reader, writer, over):
        task.add_done_callback(_seen)
    try:
        await asyncio.wait({reader, writer, over}, return_when=asyncio.FIRST_COMPLETED)
    finally:
        links.ended(lane)
        lane.outbox.close()
        reader.cancel()
        said, _ = await asyncio.wait({writer}, timeout=GOODBYE_S)
        writer.cancel()
        await asyncio.gather(reader, writer, over, return_exceptions=True)
    return bool(said)


def _seen(task: asyncio.Task[None]) -> None:
    """How a lane's parts end when its connection is torn down is nothing for the log."""
    if not task.cancelled():
        task.exception()


async def _ask(challenge: link_pb2.Challenge, read: Read, write: Write) -> bytes:
    """Send a challenge; the signature that answers it."""
    await write(link_pb2.GatewayFrame(challenge=challenge))
    answer = await read()
    if answer is None or answer.WhichOneof("frame") != "proof":
        raise ProtocolError("a Challenge is answered by a Proof")
    return answer.proof.signature


async def _read(links: Links, lane: Lane, read: Read) -> None:
    while (frame := await read()) is not None:
        await links.receive(lane, frame)


async def _write(lane: Lane, write: Write) -> None:
    try:
        while (frame := await lane.outbox.next()) is not None:
            await write(frame)
    except LaneGoneError as error:
        log.debug("a lane of %s ended: %s", lane.robot_id, error)


async def _in_time(writing: Awaitable[None]) -> bool:
    try:
        async with asyncio.timeout(GOODBYE_S):
            await writing
    except (TimeoutError, LinkError):
        return False
    return True
