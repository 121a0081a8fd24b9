"""The errors of the edge agent, as a tree. Every leaf carries a stable `code`, which is also a CommandResult's code.

MetarosError (metaros.errors)
├── UsageError
│   ├── CommandError          a remote command cannot be carried out
│   │   ├── ExpiredError      it came, or would end, after its deadline            expired
│   │   ├── DuplicateError    its id was executed before                           duplicate
│   │   ├── LeaseError        an actuator without the current lease                lease_required
│   │   ├── StaleError        too old to move the robot                            stale
│   │   ├── TalkOffError      this robot lets nobody talk through its speaker      talk_off
│   │   ├── PacketError       no packet of speech, or one too many                 bad_packet
│   │   ├── BusyError         too many commands at once                            busy
│   │   ├── BlackBoxOffError  there is no black box to cut from                    black_box_off
│   │   ├── NothingRecordedError  the black box holds nothing of that time         nothing_there
│   │   ├── ManyRecordingsError   too many of them wait for the gateway            too_many_recordings
│   │   ├── TwinRulesError    the robot's twin says what it is to be               twin_rules
│   │   ├── TakenError        somebody serves that name already                    taken
│   │   └── UnsupportedError  a command this agent does not know                   unsupported
│   ├── TokenFormatError      that is no enrolment token                           token_malformed
│   └── InsecureGatewayError  an identity is not shown without TLS                 insecure_gateway
├── PeerError
│   ├── EnrolError            the robot got no certificate
│   │   ├── EnrolRefusedError     the gateway says no; `reason` holds its code     enrol_refused
│   │   ├── EnrolAnswerError      its answer is no certificate for our key         enrol_answer
│   │   ├── PinError          the gateway's root is not the one of the token       pin_mismatch
│   │   └── UntrustedError    its TLS certificate is not to be trusted             gateway_untrusted
│   └── LinkError             the link ended
│       ├── BehindError       the gateway has more than the outbox ever accepted    outbox_behind
│       ├── LinkDeadError     nothing received for too long                        link_dead
│       ├── UnprovenError     it asks for a proof that this robot cannot give      unproven
│       └── RefusedError      the gateway said goodbye; `reason` holds its code    refused
├── IdentityFileError         the robot's identity cannot be read or kept          identity_file
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
    "EnrolAnswerError",
    "EnrolError",
    "EnrolRefusedError",
    "ExpiredError",
    "IdentityFileError",
    "InsecureGatewayError",
    "LeaseError",
    "LinkDeadError",
    "LinkError",
    "ManyRecordingsError",
    "NothingRecordedError",
    "PacketError",
    "PinError",
    "RefusedError",
    "ScopeError",
    "StaleError",
    "TakenError",
    "TalkOffError",
    "TokenFormatError",
    "TwinRulesError",
    "UnprovenError",
    "UnsupportedError",
    "UntrustedError",
]


class CommandError(UsageError):
    """A remote command cannot be carried out."""

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


class TalkOffError(CommandError):
    """The robot's own settings let nobody talk through its speaker."""

    code = "talk_off"


class PacketError(CommandError):
    """No packet of speech, or one too many."""

    code = "bad_packet"


class StaleError(CommandError):
    """The command was sent too long ago, by the gateway's clock, to move the robot."""

    code = "stale"


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


class TwinRulesError(CommandError):
    """What the command would change is what the robot's twin says: it is changed there."""

    code = "twin_rules"


class TakenError(CommandError):
    """Somebody in the robot's graph serves that name already."""

    code = "taken"


class UnsupportedError(CommandError):
    """A command of a kind that this agent does not know."""

    code = "unsupported"


class TokenFormatError(UsageError):
    """The text is no enrolment token."""

    code = "token_malformed"


class InsecureGatewayError(UsageError):
    """A token or an identity is shown to a gateway beyond this machine over TLS only."""

    code = "insecure_gateway"


class EnrolError(PeerError):
    """The robot got no certificate; what it had before still holds."""

    code = "enrol"


class EnrolRefusedError(EnrolError):
    """The gateway gives no certificate; `reason` is its code."""

    code = "enrol_refused"

    def __init__(self, reason: str, message: str) -> None:
        super().__init__(f"the gateway said {reason}: {message}" if message else f"the gateway said {reason}")
        self.reason = reason


class EnrolAnswerError(EnrolError):
    """What the gateway answered is no certificate for this robot and its key."""

    code = "enrol_answer"


class PinError(EnrolError):
    """The gateway's root certificate is not the one that the token names."""

    code = "pin_mismatch"


class UntrustedError(EnrolError):
    """The gateway's TLS certificate is neither of the fleet's root nor of an authority that this system trusts."""

    code = "gateway_untrusted"


class LinkError(PeerError):
    """The link to the gateway ended."""

    code = "link"


class BehindError(LinkError):
    """The gateway has numbers that this outbox never gave: it is an older copy of the one that did."""

    code = "outbox_behind"


class LinkDeadError(LinkError):
    """The gateway was silent for longer than the link allows."""

    code = "link_dead"


class UnprovenError(LinkError):
    """The gateway asks for a proof of identity that this robot cannot, or must not, give."""

    code = "unproven"


class RefusedError(LinkError):
    """The gateway ended the link on purpose."""

    code = "refused"

    def __init__(self, reason: str, message: str, *, retry_after_s: float = 0.0) -> None:
        super().__init__(f"gateway said {reason}: {message}" if message else f"gateway said {reason}")
        self.reason = reason
        self.retry_after_s = retry_after_s


class IdentityFileError(MetarosError):
    """The robot's identity cannot be read from its file, or not be kept there."""

    code = "identity_file"


class DiskError(MetarosError):
    """The outbox's disk failed: a read, write, sync or rename that did not work."""

    code = "disk_error"


class DiskFullError(DiskError):
    """There is no space left on the outbox's disk, or its quota is used up."""

    code = "disk_full"


class CorruptError(DiskError):
    """A file of the outbox holds bytes that the outbox did not write like that."""

    code = "disk_corrupt"
