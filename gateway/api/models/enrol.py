"""Robots' identities in the API's documents: what a request may hold and what answers it."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from gateway.api.models.base import Exact

__all__ = [
    "ChallengeRequest",
    "EnrolChallenge",
    "EnrolRequest",
    "Enrolment",
    "EnrolmentToken",
    "EnrolmentTokenList",
    "FleetRoots",
    "IdentityList",
    "NewEnrolmentToken",
    "RenewRequest",
    "RevokeRequest",
    "RobotCertificate",
    "RobotIdentity",
    "TokenOrder",
]

PEM_CHARS = 16 * 1024


class FleetRoots(Exact):
    """By what a robot recognises its fleet: `roots` in PEM, and the pins that enrolment tokens carry."""

    fleet: str
    roots: str
    pins: list[str]


class EnrolRequest(Exact):
    """A token, the robot's name and its request for a certificate (PKCS #10, PEM)."""

    token: str = Field(max_length=256)
    robot: str = Field(max_length=64)
    csr: str = Field(max_length=PEM_CHARS)


class ChallengeRequest(Exact):
    """Which robot wants to renew."""

    robot: str = Field(max_length=64)


class EnrolChallenge(Exact):
    """32 bytes to sign, base64url; whom the signature is for, and for how long."""

    nonce: str
    audience: str
    valid_s: float


class RenewRequest(Exact):
    """The old certificate, the request for the next with a new key, and the old key's signature (base64url)."""

    robot: str = Field(max_length=64)
    nonce: str = Field(max_length=64)
    certificate: str = Field(max_length=PEM_CHARS)
    csr: str = Field(max_length=PEM_CHARS)
    proof: str = Field(max_length=512)


class Enrolment(Exact):
    """A robot's certificate with what goes above it, in PEM, and where it connects; `grpc_port` 0: over HTTP alone.

    `vouchers` are certificates by which earlier roots confirm those that follow them; mostly there are none.
    """

    robot: str
    fleet: str
    certificate: str
    chain: str
    roots: str
    vouchers: str
    not_after: str
    now: str
    grpc_port: int
    grpc_tls: bool


class TokenOrder(Exact):
    """For which robot ("": any that has no identity), and for how long."""

    robot: str = Field(default="", max_length=64)
    ttl_s: float = Field(default=3600.0, ge=60.0, le=86_400.0)


class EnrolmentToken(Exact):
    """A token without its secret."""

    id: str
    robot: str
    made: str
    made_by: str
    expires: str
    used: str | None
    used_by: str


class NewEnrolmentToken(EnrolmentToken):
    """The whole token, told this once, and the command that uses it."""

    token: str
    command: str


class EnrolmentTokenList(Exact):
    """The newest first."""

    tokens: list[EnrolmentToken]
    next: str | None


class RobotCertificate(Exact):
    """One certificate of a robot."""

    serial: str
    how: Literal["token", "renewal", "grace"]
    issued: str
    not_after: str
    revoked: str | None


class RobotIdentity(Exact):
    """A robot's identity; `alarm` says what looks like a copy of the robot."""

    robot: str
    state: Literal["active", "revoked"]
    enrolled: str
    revoked: str | None
    reason: str
    alarm: str
    alarm_at: str | None
    certificates: list[RobotCertificate]


class IdentityList(Exact):
    """By robot."""

    identities: list[RobotIdentity]
    next: str | None


class RevokeRequest(Exact):
    """Why, for whoever looks later."""

    reason: str = Field(max_length=200)
