"""The errors of the edge agent, as a tree. Every leaf carries a stable `code`, which is also a CommandResult's code.

MetarosError (metaros.errors)
├── UsageError
│   └── CommandError          a command from afar cannot be carried out
│       ├── ExpiredError      it came, or would end, after its deadline            expired
│       ├── DuplicateError    its id was executed before                           duplicate
│       ├── LeaseError        an actuator without the current lease                lease_required
│       ├── BusyError         too many commands at once                            busy
│       └── UnsupportedError  a command this agent does not know                   unsupported
└── PeerError
    └── LinkError             the link ended
        ├── LinkDeadError     nothing heard for too long                           link_dead
        └── RefusedError      the gateway said goodbye; `reason` holds its code    refused
"""

from __future__ import annotations

from metaros.errors import PeerError, UsageError

__all__ = [
    "BusyError",
    "CommandError",
    "DuplicateError",
    "ExpiredError",
    "LeaseError",
    "LinkDeadError",
    "LinkError",
    "RefusedError",
    "ScopeError",
    "UnsupportedError",
]


class CommandError(UsageError):
    """A command from afar cannot be carried out."""

    code = "command"


class ExpiredError(CommandError):
    """The command came, or would end, after its deadline."""

    code = "expired"


class DuplicateError(CommandError):
    """A command of this id was executed before."""

    code = "duplicate"


class LeaseError(CommandError):
    """An actuator topic accepts commands only under the current lease."""

    code = "lease_required"


class ScopeError(CommandError):
    """The command names a topic or service outside the agent's namespace."""

    code = "out_of_scope"


class BusyError(CommandError):
    """More commands are under way than the agent runs at once."""

    code = "busy"


class UnsupportedError(CommandError):
    """A command of a kind that this agent does not know."""

    code = "unsupported"


class LinkError(PeerError):
    """The link to the gateway ended."""

    code = "link"


class LinkDeadError(LinkError):
    """The gateway was silent for longer than the link allows."""

    code = "link_dead"


class RefusedError(LinkError):
    """The gateway ended the link on purpose."""

    code = "refused"

    def __init__(self, reason: str, message: str, *, retry_after_s: float = 0.0) -> None:
        super().__init__(f"gateway said {reason}: {message}" if message else f"gateway said {reason}")
        self.reason = reason
        self.retry_after_s = retry_after_s
