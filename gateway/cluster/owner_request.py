"""Asking the gateway that has a robot's link; that it cannot be reached is told as a robot without a link is."""

from __future__ import annotations

from collections.abc import Callable

from gateway.cluster.errors import PeerBusyError, PeerGoneError, PeerTimeoutError
from gateway.cluster.ports import Mesh
from gateway.errors import CommandTimeoutError, RobotOfflineError, TooManyError

__all__ = ["HomeOf", "ask_home"]

HomeOf = Callable[[str], str]  # a robot; the id of the gateway that has its link, "" = this one, or none


async def ask_home(mesh: Mesh, home: str, verb: str, payload: bytes, *, robot: str, timeout_s: float) -> bytes:
    """What the robot's home answers.

    Raises:
        RobotOfflineError: the home is gone.
        CommandTimeoutError: it does not answer in time; what it did is not known.
        TooManyError: too much waits for it already.
        GatewayError: what it answered with.
    """
    try:
        return await mesh.ask(home, verb, payload, timeout_s=timeout_s)
    except PeerGoneError as error:
        raise RobotOfflineError(f"robot {robot} has no link now: the gateway that had it is gone") from error
    except PeerTimeoutError as error:
        raise CommandTimeoutError(f"the gateway of robot {robot} gave no answer within {timeout_s:g} s") from error
    except PeerBusyError as error:
        raise TooManyError(f"too much waits for the gateway of robot {robot} already") from error
