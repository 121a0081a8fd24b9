"""A request to a robot's owner, the gateway with its link; an unreachable owner counts as an offline robot."""

from __future__ import annotations

from collections.abc import Callable

from gateway.cluster.errors import PeerBusyError, PeerGoneError, PeerTimeoutError
from gateway.cluster.ports import Mesh
from gateway.errors import CommandTimeoutError, RobotOfflineError, TooManyError

__all__ = ["OwnerOf", "ask_owner"]

OwnerOf = Callable[[str], str]  # a robot; the id of the gateway that has its link, "" = this one, or none


async def ask_owner(mesh: Mesh, owner: str, verb: str, payload: bytes, *, robot: str, timeout_s: float) -> bytes:
    """Send a request to the robot's owner and return its answer.

    Raises:
        RobotOfflineError: the owner is gone.
        CommandTimeoutError: it does not answer in time; what it did is not known.
        TooManyError: too much waits for it already.
        GatewayError: what it answered with.
    """
    try:
        return await mesh.request(owner, verb, payload, timeout_s=timeout_s)
    except PeerGoneError as error:
        raise RobotOfflineError(f"robot {robot} has no link now: the gateway that had it is gone") from error
    except PeerTimeoutError as error:
        raise CommandTimeoutError(f"the gateway of robot {robot} gave no answer within {timeout_s:g} s") from error
    except PeerBusyError as error:
        raise TooManyError(f"too much waits for the gateway of robot {robot} already") from error
