"""A command to a robot, from its issue to its one end."""

from __future__ import annotations

from dataclasses import dataclass

from gateway.domain.fleet.recording import is_recording_id, new_recording_id

__all__ = [
    "CANCELLED",
    "DELIVERED",
    "DONE",
    "EXPIRED",
    "FAILED",
    "ISSUED",
    "OPEN",
    "RUNNING",
    "STATES",
    "Command",
    "command_of_wire",
    "is_command_id",
    "new_command_id",
    "wire_id",
]

ISSUED, DELIVERED, RUNNING = "issued", "delivered", "running"
DONE, FAILED, EXPIRED, CANCELLED = "done", "failed", "expired", "cancelled"
OPEN = (ISSUED, DELIVERED, RUNNING)
STATES = (*OPEN, DONE, FAILED, EXPIRED, CANCELLED)

_ALPHABET = "0123456789ABCDEFGHJKMNPQRSTVWXYZ"
_VALUES = {letter: value for value, letter in enumerate(_ALPHABET)}
_WIRE_BYTES = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """One command as the store has it; times are ns since the epoch by the gateway's clock, 0 where it has not come.

    `issuer` is who asked, for ever ("user:ID", "key:ID"); `issued_by` their name then. `expires_ns` counts for
    durable ones. `wire` is the link's Command without id and times, empty once it is over.
    """

    id: str
    robot: str
    kind: str
    request: str
    wire: bytes
    issuer: str
    issued_by: str
    digest: str
    durable: bool
    timeout_ms: int
    issued_ns: int
    idempotency: str | None = None
    state: str = ISSUED
    expires_ns: int = 0
    delivered_ns: int = 0
    running_ns: int = 0
    ended_ns: int = 0
    code: str = ""  # why it failed
    message: str = ""
    result: str = ""  # JSON

    @property
    def over(self) -> bool:
        """Whether it has come to its end."""
        return self.state not in OPEN


def new_command_id(now_ns: int) -> str:
    """A ULID: sorts by time."""
    return new_recording_id(now_ns)


def is_command_id(text: str) -> bool:
    """Whether a text is an id as `new_command_id` makes them: 26 letters hold 130 bits, an id has 128."""
    return is_recording_id(text) and text[0] <= "7"


def wire_id(command_id: str) -> bytes:
    """The id on the link: 16 bytes."""
    number = 0
    for letter in command_id:
        number = number << 5 | _VALUES[letter]
    return number.to_bytes(_WIRE_BYTES, "big")


def command_of_wire(wire: bytes) -> str | None:
    """The reverse; None for what is no such id."""
    if len(wire) != _WIRE_BYTES:
        return None
    number = int.from_bytes(wire, "big")
    return "".join(_ALPHABET[number >> shift & 31] for shift in range(125, -5, -5))
