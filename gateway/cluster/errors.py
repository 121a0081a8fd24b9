"""The errors between gateways; their codes are rows of the gateway's table.

GatewayError
├── PeerGoneError              the other gateway is not there, or went before it answered   peer_gone
├── PeerTimeoutError           it did not answer in time                                    peer_timeout
├── PeerBusyError              so much waits for it already that this was not sent          peer_busy
└── PeerRefusedError           it answered with an error, whose code this one has

What a gateway answers with crosses as code, text and what else its kind says. Where the kind is one of
`gateway.errors` it is raised as that here, so that the API answers as if it had happened at this gateway.
"""

from __future__ import annotations

import json
from typing import Any, Final

import gateway.errors as kinds
from gateway.errors import CommandRefusedError, GatewayError, LeaseTakenError, TooManyRequestsError
from metaros.errors import MetarosError

__all__ = [
    "PeerBusyError",
    "PeerGoneError",
    "PeerRefusedError",
    "PeerTimeoutError",
    "pack_error",
    "unpack_error",
]

TEXT_CHARS: Final = 2000  # of a message that crosses
INTERNAL: Final = "the gateway that has the robot failed; its log says how"


class PeerGoneError(GatewayError):
    """The other gateway is not there, or went before it answered: whether it acted is not known."""

    code = "peer_gone"


class PeerTimeoutError(GatewayError):
    """The other gateway gave no answer in time; whether it acted is not known."""

    code = "peer_timeout"


class PeerBusyError(GatewayError):
    """So much waits for the other gateway already that this was not sent; the same may work in a moment."""

    code = "peer_busy"


class PeerRefusedError(GatewayError):
    """The other gateway answered with an error; `code` is that error's own."""

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code  # type: ignore[misc]


def _plain_kinds() -> dict[str, type[GatewayError]]:
    """By code, the errors of the gateway that are made of a message alone; of several the most general one."""
    found: dict[str, type[GatewayError]] = {}
    for kind in vars(kinds).values():
        own = isinstance(kind, type) and issubclass(kind, GatewayError) and kind is not GatewayError
        if own and kind.__init__ is Exception.__init__:
            found.setdefault(kind.code, kind)
    return found


_PLAIN: Final = _plain_kinds()


def pack_error(error: Exception) -> bytes:
    """An error for the way back; one that nobody raised on purpose says no more than that."""
    if not isinstance(error, MetarosError):
        return json.dumps({"code": "internal", "message": INTERNAL}).encode()
    facts: dict[str, Any] = {"code": error.code, "message": str(error)[:TEXT_CHARS]}
    for name in ("agent_code", "holder", "retry_after_s"):
        if hasattr(error, name):
            facts[name] = getattr(error, name)
    return json.dumps(facts).encode()


def unpack_error(packed: bytes) -> GatewayError:
    """The error that a gateway answered with."""
    facts = json.loads(packed)
    code, message = str(facts["code"]), str(facts["message"])
    if "agent_code" in facts:
        return CommandRefusedError(message, agent_code=str(facts["agent_code"]))
    if code == LeaseTakenError.code and "holder" in facts:
        return LeaseTakenError(message, holder=str(facts["holder"]))
    if code == TooManyRequestsError.code and "retry_after_s" in facts:
        return TooManyRequestsError(message, retry_after_s=float(facts["retry_after_s"]))
    kind = _PLAIN.get(code)
    return kind(message) if kind is not None else PeerRefusedError(code, message)
