"""The errors of `metaros`, as a tree. Every leaf carries a stable `code` for machines.

    MetarosError
    ├── UsageError                the caller's fault
    │   ├── NameError_            a ROS name, key or namespace breaks the grammar        invalid_name
    │   ├── DefinitionError       an interface definition cannot be parsed              invalid_definition
    │   ├── UnknownTypeError      no such interface in the catalogue                    unknown_type
    │   ├── FieldError            a value does not fit its field                        invalid_field
    │   ├── ConfigError           a setting or an option is wrong                       invalid_config
    │   ├── ParameterError        a parameter's value or declaration is refused         invalid_parameter
    │   │   └── UnknownParameterError   no parameter of that name was declared          unknown_parameter
    │   ├── KeyringError          the file of sealing keys is missing, open to others, or damaged   keyring
    │   ├── SealedError           a sealed payload is not decoded without its key       sealed
    │   └── ClosedError           the node, session or publisher was closed             closed
    ├── RecordingError            a recording cannot be written or read               recording
    ├── PackageError              a zip file of a function's code is refused          invalid_package
    ├── SandboxError              functions cannot be shut in as far as required      sandbox_unavailable
    │   └── LaunchError           a function's worker could not be started            launch_failed
    └── PeerError                 the other side's fault
        ├── RefusedError          a gateway refused the request, or failed at it        refused
        ├── DecodeError           bytes that are no valid CDR of the type               malformed_cdr
        ├── AttachmentError       a sample's attachment is missing or malformed         malformed_attachment
        ├── TokenError            a liveliness token cannot be read                     malformed_token
        ├── SealError             a sealed payload is not what its robot sealed, there  seal_broken
        │   ├── SealFormatError   bytes that are no sealed payload                      malformed_seal
        │   ├── SealKeyError      sealed by a key that the keyring lacks                seal_key_unknown
        │   └── ReplayError       the same sealed payload came before                   seal_replayed
        ├── FrameError            a link frame breaks the protocol                      malformed_frame
        ├── TypeHashError         same type name, another hash                          type_hash_mismatch
        ├── TooLargeError         a message or frame is over its limit                  too_large
        ├── TimeoutError_         no answer in time                                     timeout
        └── UnavailableError      nobody there to answer                                unavailable
            └── PeerRestartedError    the server that had the goal is gone               peer_restarted

`NameError_` and `TimeoutError_` end in an underscore because the plain names are Python's own.
"""

from __future__ import annotations

from typing import ClassVar

__all__ = [
    "AttachmentError",
    "ClosedError",
    "ConfigError",
    "DecodeError",
    "DefinitionError",
    "FieldError",
    "FrameError",
    "KeyringError",
    "LaunchError",
    "MetarosError",
    "NameError_",
    "PackageError",
    "ParameterError",
    "PeerError",
    "PeerRestartedError",
    "RecordingError",
    "RefusedError",
    "ReplayError",
    "SandboxError",
    "SealError",
    "SealFormatError",
    "SealKeyError",
    "SealedError",
    "TimeoutError_",
    "TokenError",
    "TooLargeError",
    "TypeHashError",
    "UnavailableError",
    "UnknownParameterError",
    "UnknownTypeError",
    "UsageError",
]


class MetarosError(Exception):
    """Root of every error this library raises on purpose."""

    code: ClassVar[str] = "error"


class UsageError(MetarosError):
    """The caller asked for something that cannot be."""

    code = "usage"


class NameError_(UsageError):
    """A ROS name, key or namespace breaks the grammar."""

    code = "invalid_name"


class DefinitionError(UsageError):
    """An interface definition cannot be parsed; the message names the line."""

    code = "invalid_definition"


class UnknownTypeError(UsageError):
    """No interface of that name in the catalogue."""

    code = "unknown_type"


class FieldError(UsageError):
    """A value does not fit its field; the message names the field and the limit."""

    code = "invalid_field"


class ConfigError(UsageError):
    """A setting or a command-line option is wrong."""

    code = "invalid_config"


class ParameterError(UsageError):
    """A parameter's value or declaration is refused; the message says why."""

    code = "invalid_parameter"


class UnknownParameterError(ParameterError):
    """No parameter of that name was declared."""

    code = "unknown_parameter"


class KeyringError(UsageError):
    """The file of sealing keys is missing, readable for others, or damaged; the message says which and what to do."""

    code = "keyring"


class SealedError(UsageError):
    """The payload is sealed, and is not decoded where its key is not."""

    code = "sealed"


class ClosedError(UsageError):
    """The node, session or publisher was closed before."""

    code = "closed"


class RecordingError(MetarosError):
    """A recording cannot be written (a full disk) or read (no MCAP, damaged); the message says what was kept."""

    code = "recording"


class PackageError(MetarosError):
    """A zip file of a function's code or a layer is refused; the message names the member and the limit."""

    code = "invalid_package"


class SandboxError(MetarosError):
    """This machine cannot shut functions in as far as is required; the message says why."""

    code = "sandbox_unavailable"


class LaunchError(SandboxError):
    """A function's worker could not be started, or not shut in; nothing of it is left."""

    code = "launch_failed"


class PeerError(MetarosError):
    """The other side sent something wrong, or nothing."""

    code = "peer"


class RefusedError(PeerError):
    """A gateway refused a request, or failed at it: `status` is HTTP's, `reason` its own stable code, "" if unknown."""

    code = "refused"

    def __init__(self, message: str, *, status: int = 0, reason: str = "") -> None:
        super().__init__(message)
        self.status = status
        self.reason = reason


class DecodeError(PeerError):
    """Bytes that are no valid CDR of the type they claim to be."""

    code = "malformed_cdr"


class AttachmentError(PeerError):
    """A sample's attachment is missing or malformed."""

    code = "malformed_attachment"


class TokenError(PeerError):
    """A liveliness token cannot be read."""

    code = "malformed_token"


class SealError(PeerError):
    """A sealed payload was changed, or is not where its robot put it: another robot, topic, type or number."""

    code = "seal_broken"


class SealFormatError(SealError):
    """Bytes that are no sealed payload."""

    code = "malformed_seal"


class SealKeyError(SealError):
    """Sealed by a key that the keyring does not hold; the message names the key."""

    code = "seal_key_unknown"


class NotSealedError(SealError):
    """A topic that has to be sealed is not: whoever passed it on may have put anything there."""

    code = "not_sealed"


class ReplayError(SealError):
    """A sealed payload that came before."""

    code = "seal_replayed"


class FrameError(PeerError):
    """A frame of the agent-gateway link breaks the protocol."""

    code = "malformed_frame"


class TypeHashError(PeerError):
    """The peer's type has our name but another hash: its fields differ."""

    code = "type_hash_mismatch"


class TooLargeError(PeerError):
    """A message or frame is over its limit."""

    code = "too_large"


class TimeoutError_(PeerError):
    """No answer in time."""

    code = "timeout"


class UnavailableError(PeerError):
    """Nobody there to answer."""

    code = "unavailable"


class PeerRestartedError(UnavailableError):
    """The server that worked on it died, or was restarted since: what it had is lost, send it again."""

    code = "peer_restarted"
