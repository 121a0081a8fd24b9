"""The errors of the edge agent, as a tree. Every leaf carries a stable `code`, which is also a CommandResult's code.

MetarosError (metaros.errors)
├── UsageError
│   └── CommandError          a command from afar cannot be carried out
│       ├── ExpiredError      it came, or would end, after its deadline            expired
│       ├── DuplicateError    its id was executed before                           duplicate
│       ├── LeaseError        an actuator without the current lease                lease_required
│       ├── BusyError         too many commands at once                            busy
│       ├── BlackBoxOffError  there is no black box to cut from                    black_box_off
│       ├── NothingRecordedError  the black box holds nothing of that time         nothing_there
│       ├── ManyRecordingsError   too many of them wait for the gateway            too_many_recordings
│       └── UnsupportedError  a command this agent does not know                   unsupported
├── PeerError
│   └── LinkError             the link ended
│       ├── BehindError       the gateway has more than the outbox ever accepted    outbox_behind
│       ├── LinkDeadError     nothing heard for too long                           link_dead
│       └── RefusedError      the gateway said goodbye; `reason` holds its code    refused
└── DiskError                 the outbox's disk failed                             disk_error
    ├── DiskFullError         there is no space left on it                         disk_full
    └── CorruptError          bytes that the outbox did not write like that        disk_corrupt
"""

from __future__ import annotations

from metaros.errors import MetarosError, PeerError, UsageError

__all__ = [
    "BehindError",
    "BlackBoxOffError",
    "BusyError",
    "CommandError",
    "CorruptError",
    "DiskError",
    "DiskFullError",
    "DuplicateError",
    "ExpiredError",
    "LeaseError",
    "LinkDeadError",
    "LinkError",
    "ManyRecordingsError",
    "NothingRecordedError",
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


class BlackBoxOffError(CommandError):
    """There is no black box to cut a recording from: it is off, or its disk does not work."""

    code = "black_box_off"


class NothingRecordedError(CommandError):
    """The black box holds nothing of the time and the topics that were asked for."""

    code = "nothing_there"


class ManyRecordingsError(CommandError):
    """As many recordings as the robot keeps wait for the gateway already."""

    code = "too_many_recordings"


class UnsupportedError(CommandError):
    """A command of a kind that this agent does not know."""

    code = "unsupported"


class LinkError(PeerError):
    """The link to the gateway ended."""

    code = "link"


class BehindError(LinkError):
    """The gateway has numbers that this outbox never gave: it is an older copy of the one that did."""

    code = "outbox_behind"


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


class DiskError(MetarosError):
    """The outbox's disk failed: a read, write, sync or rename that did not work."""

    code = "disk_error"


class DiskFullError(DiskError):
    """There is no space left on the outbox's disk, or its quota is used up."""

    code = "disk_full"


class CorruptError(DiskError):
    """A file of the outbox holds bytes that the outbox did not write like that."""

    code = "disk_corrupt"
