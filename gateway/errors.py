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
    │   ├── IdentityError            a robot's token, certificate or proof is refused: its code says which one
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
    │   ├── UnsettledError           what its last process sent is still being stored   unsettled
    │   └── UnprovenError            it is not who it says; has the code of an IdentityError
    ├── AuthorityError               this gateway cannot issue certificates now         ca_unavailable
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

from typing import ClassVar

from gateway.error_table import ERRORS, ErrorRow
from metaros.errors import MetarosError

__all__ = [
    "ERRORS",
    "AuthorityError",
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
    "IdentityError",
    "InvalidRequestError",
    "LeaseRequiredError",
    "LeaseTakenError",
    "LinkBusyError",
    "LinkError",
    "MediaTypeError",
    "ObjectMissingError",
    "ObjectRefusedError",
    "ObjectStoreError",
    "OriginError",
    "OverloadedError",
    "ProtocolError",
    "ProxyOnlyError",
    "PurgedError",
    "RecordingNotStoredError",
    "RequestError",
    "RequestTimeoutError",
    "RobotError",
    "RobotOfflineError",
    "SignInError",
    "StoreError",
    "TooManyError",
    "TooManyRequestsError",
    "UnknownRecordingError",
    "UnknownRobotError",
    "UnknownTopicError",
    "UnprovenError",
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
    """No robot of that id has ever connected here, as far as who asks may know."""

    code = "unknown_robot"

    @classmethod
    def of(cls, robot_id: str) -> UnknownRobotError:
        """In the same words whether there is none or it is out of scope."""
        return cls(f"no robot {robot_id[:64]!r} has ever connected; GET /api/v1/robots lists them")


class UnknownTopicError(RequestError):
    """The robot announces no such topic."""

    code = "unknown_topic"


class UnknownRecordingError(RequestError):
    """There is no such recording, as far as who asks may know."""

    code = "unknown_recording"

    @classmethod
    def of(cls, recording_id: str) -> UnknownRecordingError:
        """In the same words whether there is none or its robot is out of scope."""
        return cls(f"there is no recording {recording_id[:40]!r}")


class RecordingNotStoredError(RequestError):
    """The recording has no file here: it is still on its way, or it failed."""

    code = "recording_not_stored"


class HostError(RequestError):
    """The Host header names none of this gateway's names: DNS rebinding looks like this."""

    code = "host_not_allowed"


class ProxyOnlyError(RequestError):
    """Without TLS beyond loopback a gateway takes requests of its trusted proxies alone."""

    code = "proxy_only"


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


class IdentityError(RequestError):
    """A robot's token, request, certificate or proof is not good; `code` is one of the rows and names which and why."""

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code  # type: ignore[misc]


class TooManyRequestsError(RequestError):
    """Too often; the same is welcome after `retry_after_s`."""

    code = "too_many_requests"

    def __init__(self, message: str, *, retry_after_s: float) -> None:
        super().__init__(message)
        self.retry_after_s = retry_after_s


class RequestTimeoutError(RequestError):
    """The request's body did not come in time."""

    code = "request_timeout"


class OverloadedError(GatewayError):
    """Too much is under way; the same may work in a moment."""

    code = "overloaded"


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


class LinkBusyError(LinkError):
    """Too many lanes are being opened, by an address, a robot or everybody."""

    code = "too_many_requests"
    retry_after_ms = 5000


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


class UnprovenError(LinkError):
    """A robot did not prove that it is who it says; the code is that of the IdentityError behind it."""

    def __init__(self, code: str, message: str, *, retry_after_ms: int) -> None:
        super().__init__(message)
        self.code = code  # type: ignore[misc]
        self.retry_after_ms = retry_after_ms


class AuthorityError(GatewayError):
    """The gateway's certificate authority cannot issue now: its key is not here, or cannot be read."""

    code = "ca_unavailable"


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


_BY_CODE = {row.code: row for row in ERRORS}


def error_row(error: MetarosError) -> ErrorRow:
    """The row of an error's code; a refusal that carries an agent's known code gets that code's row."""
    if isinstance(error, CommandRefusedError) and error.agent_code in _BY_CODE:
        return _BY_CODE[error.agent_code]
    return _BY_CODE.get(error.code, _BY_CODE["internal"])
