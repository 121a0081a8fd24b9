"""The gateway's errors, as a tree, and the one table that gives every code its HTTP and gRPC status.

    GatewayError
    ├── RequestError                 the client's fault
    │   ├── InvalidRequestError      a parameter or body does not fit                   invalid_request
    │   ├── UnknownRobotError        no robot of that id has ever connected             unknown_robot
    │   ├── UnknownTopicError        the robot announces no such topic                  unknown_topic
    │   ├── UnknownRecordingError    there is no such recording                         unknown_recording
    │   ├── RecordingNotStoredError  its file is not here, or not yet                   recording_not_stored
    │   ├── HostError                the Host header is not one of ours                 host_not_allowed
    │   ├── OriginError              a page of another origin asked                     origin_not_allowed
    │   ├── MediaTypeError           a mutation without a JSON or CDR body              unsupported_media_type
    │   ├── BodyTooLargeError        the body is over its limit                         body_too_large
    │   ├── LeaseRequiredError       an actuator topic without a valid lease            lease_required
    │   ├── LeaseTakenError          somebody else drives this robot                    lease_taken
    │   ├── SignInError              nobody known may do this                           sign_in
    │   ├── CredentialsError         a key, session, password or token is not good      bad_credentials
    │   ├── CsrfError                a session's mutation without its CSRF token        csrf
    │   ├── ForbiddenError           the role does not suffice                          forbidden
    │   ├── TooManyRequestsError     too often; says when to come back                  too_many_requests
    │   └── TooManyError             a bounded table is full                            too_many
    ├── RobotError                   the robot's fault
    │   ├── RobotOfflineError        the robot has no link now                          robot_offline
    │   ├── CommandTimeoutError      the robot gave no result in time                   timeout
    │   └── CommandRefusedError      the robot's agent refused; keeps the agent's code  command_refused
    ├── LinkError                    an agent's fault on the link
    │   ├── ProtocolError            a frame breaks the protocol                        protocol
    │   ├── FencedError              a newer session of this robot is alive             fenced
    │   ├── ForkedError              another copy of the robot's outbox has spoken      forked
    │   └── UnsettledError           what its last process sent is still being stored   unsettled
    ├── StoreError                   the store cannot do it now                         store_unavailable
    │   ├── UnstorableError          these values can never be stored                   store_unavailable
    │   └── PurgedError              what was found is not stored any more              purged
    ├── ObjectStoreError             the object store cannot do it now                  objects_unavailable
    │   └── ObjectRefusedError       it does not want us: secret, bucket, rights        objects_refused
    └── DamagedError                 what was stored cannot be read any more            damaged
        ├── ObjectMissingError       the object is not there                            object_missing
        └── CorruptObjectError       the object holds something else                    object_corrupt

The library's errors (`metaros.errors`) pass through with their own codes; the table below covers them too.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from metaros.errors import MetarosError

__all__ = [
    "ERRORS",
    "BodyTooLargeError",
    "CommandRefusedError",
    "CommandTimeoutError",
    "CorruptObjectError",
    "CredentialsError",
    "CsrfError",
    "DamagedError",
    "ErrorRow",
    "FencedError",
    "ForbiddenError",
    "ForkedError",
    "GatewayError",
    "HostError",
    "InvalidRequestError",
    "LeaseRequiredError",
    "LeaseTakenError",
    "LinkError",
    "MediaTypeError",
    "ObjectMissingError",
    "ObjectRefusedError",
    "ObjectStoreError",
    "OriginError",
    "ProtocolError",
    "PurgedError",
    "RecordingNotStoredError",
    "RequestError",
    "RobotError",
    "RobotOfflineError",
    "SignInError",
    "StoreError",
    "TooManyError",
    "TooManyRequestsError",
    "UnknownRecordingError",
    "UnknownRobotError",
    "UnknownTopicError",
    "UnsettledError",
    "UnstorableError",
    "error_row",
]


class GatewayError(MetarosError):
    """Root of every error the gateway raises on purpose."""

    code: ClassVar[str] = "internal"


class RequestError(GatewayError):
    """The client asked for something that cannot be."""

    code = "invalid_request"


class InvalidRequestError(RequestError):
    """A parameter or a body does not fit; the message names it."""

    code = "invalid_request"


class UnknownRobotError(RequestError):
    """No robot of that id has ever connected here."""

    code = "unknown_robot"


class UnknownTopicError(RequestError):
    """The robot announces no such topic."""

    code = "unknown_topic"


class UnknownRecordingError(RequestError):
    """There is no such recording."""

    code = "unknown_recording"


class RecordingNotStoredError(RequestError):
    """The recording has no file here: it is still on its way, or it failed."""

    code = "recording_not_stored"


class HostError(RequestError):
    """The Host header names none of this gateway's names: DNS rebinding looks like this."""

    code = "host_not_allowed"


class OriginError(RequestError):
    """A page of another origin asked."""

    code = "origin_not_allowed"


class MediaTypeError(RequestError):
    """A mutation whose body is neither JSON nor CDR."""

    code = "unsupported_media_type"


class BodyTooLargeError(RequestError):
    """A request body over its limit."""

    code = "body_too_large"


class LeaseRequiredError(RequestError):
    """An actuator topic was addressed without a valid teleop lease."""

    code = "lease_required"


class LeaseTakenError(RequestError):
    """Somebody else holds the robot's teleop lease."""

    code = "lease_taken"

    def __init__(self, message: str, *, holder: str) -> None:
        super().__init__(message)
        self.holder = holder


class SignInError(RequestError):
    """Nobody known may do this: it needs a session or a key."""

    code = "sign_in"


class CredentialsError(RequestError):
    """A key, session, password or token that is wrong, expired or revoked: which of them is not told."""

    code = "bad_credentials"


class CsrfError(RequestError):
    """A mutation with a session's cookie and without the session's token in X-CSRF-Token."""

    code = "csrf"


class ForbiddenError(RequestError):
    """Who asks is known, and its role does not suffice; the message names the permission."""

    code = "forbidden"


class TooManyRequestsError(RequestError):
    """Too often; the same is welcome after `retry_after_s`."""

    code = "too_many_requests"

    def __init__(self, message: str, *, retry_after_s: float) -> None:
        super().__init__(message)
        self.retry_after_s = retry_after_s


class TooManyError(RequestError):
    """A bounded table is full."""

    code = "too_many"


class RobotError(GatewayError):
    """The robot did not do what it was asked."""

    code = "command_refused"


class RobotOfflineError(RobotError):
    """The robot has no link now."""

    code = "robot_offline"


class CommandTimeoutError(RobotError):
    """The robot gave no result in time; whether it acted is not known."""

    code = "timeout"


class CommandRefusedError(RobotError):
    """The robot's agent refused or failed the command; `agent_code` is its own code."""

    code = "command_refused"

    def __init__(self, message: str, *, agent_code: str) -> None:
        super().__init__(message)
        self.agent_code = agent_code


class LinkError(GatewayError):
    """An agent broke the rules of the link; the code goes into its Goodbye."""

    code = "protocol"
    retry_after_ms = 1000  # how long the agent stays away


class ProtocolError(LinkError):
    """A frame breaks the protocol."""

    code = "protocol"


class FencedError(LinkError):
    """A newer session of the same robot is alive."""

    code = "fenced"


class ForkedError(LinkError):
    """Another copy of the robot's outbox has spoken under the same epoch."""

    code = "forked"


class UnsettledError(LinkError):
    """What the agent's last process sent is still being stored: it may come back in a moment."""

    code = "unsettled"
    retry_after_ms = 50  # about a commit


class StoreError(GatewayError):
    """The store cannot do it now."""

    code = "store_unavailable"


class UnstorableError(StoreError):
    """The database takes these values never, whatever is done about it: a mistake of ours."""

    code = "store_unavailable"


class ObjectStoreError(GatewayError):
    """The object store cannot do it now; the same may work later."""

    code = "objects_unavailable"


class ObjectRefusedError(ObjectStoreError):
    """The object store refuses: a wrong secret, no such bucket, no right. It works once somebody has mended that."""

    code = "objects_refused"


class DamagedError(GatewayError):
    """What was stored cannot be read any more; the message names it."""

    code = "damaged"


class ObjectMissingError(DamagedError):
    """There is no object of that name, or it is shorter than it was."""

    code = "object_missing"


class CorruptObjectError(DamagedError):
    """The bytes are not those that were meant: a checksum or a form does not hold."""

    code = "object_corrupt"


class PurgedError(StoreError):
    """What was found a moment ago is not stored any more."""

    code = "purged"


@dataclass(frozen=True, slots=True)
class ErrorRow:
    """What a code means to a client."""

    code: str
    http: int
    grpc: str
    title: str


ERRORS: tuple[ErrorRow, ...] = (
    ErrorRow("invalid_request", 400, "INVALID_ARGUMENT", "The request does not fit"),
    ErrorRow("invalid_name", 400, "INVALID_ARGUMENT", "A ROS name breaks the grammar"),
    ErrorRow("invalid_definition", 400, "INVALID_ARGUMENT", "An interface definition cannot be parsed"),
    ErrorRow("invalid_field", 400, "INVALID_ARGUMENT", "A value does not fit its field"),
    ErrorRow("unknown_type", 400, "INVALID_ARGUMENT", "No such interface type is known"),
    ErrorRow("malformed_cdr", 400, "INVALID_ARGUMENT", "The bytes are no CDR of that type"),
    ErrorRow("sign_in", 401, "UNAUTHENTICATED", "Sign in, or send a key"),
    ErrorRow("bad_credentials", 401, "UNAUTHENTICATED", "The credentials are not good, or not any more"),
    ErrorRow("csrf", 403, "PERMISSION_DENIED", "The session's token is missing from X-CSRF-Token"),
    ErrorRow("forbidden", 403, "PERMISSION_DENIED", "The role does not suffice"),
    ErrorRow("host_not_allowed", 403, "PERMISSION_DENIED", "The Host header is not allowed"),
    ErrorRow("origin_not_allowed", 403, "PERMISSION_DENIED", "The Origin is not allowed"),
    ErrorRow("out_of_scope", 403, "PERMISSION_DENIED", "The topic or service is not the robot's own"),
    ErrorRow("not_found", 404, "NOT_FOUND", "There is nothing at this path"),
    ErrorRow("unknown_robot", 404, "NOT_FOUND", "No such robot"),
    ErrorRow("unknown_recording", 404, "NOT_FOUND", "No such recording"),
    ErrorRow("unknown_topic", 404, "NOT_FOUND", "No such topic"),
    ErrorRow("method_not_allowed", 405, "UNIMPLEMENTED", "This path does not take that method"),
    ErrorRow("duplicate", 409, "ALREADY_EXISTS", "The robot has seen this command before"),
    ErrorRow("recording_not_stored", 409, "FAILED_PRECONDITION", "The recording has no file here, or not yet"),
    ErrorRow("lease_required", 409, "FAILED_PRECONDITION", "A valid teleop lease is required"),
    ErrorRow("lease_taken", 409, "FAILED_PRECONDITION", "Somebody else holds the teleop lease"),
    ErrorRow("type_hash_mismatch", 409, "FAILED_PRECONDITION", "The robot's type has the same name but other fields"),
    ErrorRow("body_too_large", 413, "RESOURCE_EXHAUSTED", "The body is over its limit"),
    ErrorRow("too_large", 413, "RESOURCE_EXHAUSTED", "The message is over its limit"),
    ErrorRow("unsupported_media_type", 415, "INVALID_ARGUMENT", "Send application/json or application/cdr"),
    ErrorRow("busy", 429, "RESOURCE_EXHAUSTED", "The robot has too many commands under way"),
    ErrorRow("too_many", 429, "RESOURCE_EXHAUSTED", "A bounded table is full"),
    ErrorRow("too_many_requests", 429, "RESOURCE_EXHAUSTED", "Too often: come back later"),
    ErrorRow("purged", 410, "NOT_FOUND", "It is not stored any more"),
    ErrorRow("internal", 500, "INTERNAL", "The gateway failed"),
    ErrorRow("unsupported", 501, "UNIMPLEMENTED", "The robot's agent cannot do that"),
    ErrorRow("command_refused", 502, "FAILED_PRECONDITION", "The robot refused or failed the command"),
    ErrorRow("robot_offline", 503, "UNAVAILABLE", "The robot is offline"),
    ErrorRow("unavailable", 503, "UNAVAILABLE", "Nobody on the robot answers that"),
    ErrorRow("store_unavailable", 503, "UNAVAILABLE", "The store cannot do it now"),
    ErrorRow("objects_unavailable", 503, "UNAVAILABLE", "The object store cannot do it now"),
    ErrorRow("objects_refused", 503, "UNAVAILABLE", "The object store refuses the gateway"),
    ErrorRow("damaged", 500, "DATA_LOSS", "What was stored cannot be read"),
    ErrorRow("object_missing", 500, "DATA_LOSS", "A stored object is not there"),
    ErrorRow("object_corrupt", 500, "DATA_LOSS", "A stored object holds something else"),
    ErrorRow("not_ready", 503, "UNAVAILABLE", "The gateway is not ready"),
    ErrorRow("expired", 504, "DEADLINE_EXCEEDED", "The command came too late and was not executed"),
    ErrorRow("timeout", 504, "DEADLINE_EXCEEDED", "No answer in time"),
    ErrorRow("protocol", 400, "INVALID_ARGUMENT", "A frame breaks the link protocol"),
    ErrorRow("fenced", 409, "ABORTED", "A newer session of this robot is alive"),
)

_BY_CODE = {row.code: row for row in ERRORS}


def error_row(error: MetarosError) -> ErrorRow:
    """The row of an error's code; a refusal that carries an agent's known code gets that code's row."""
    if isinstance(error, CommandRefusedError) and error.agent_code in _BY_CODE:
        return _BY_CODE[error.agent_code]
    return _BY_CODE.get(error.code, _BY_CODE["internal"])
