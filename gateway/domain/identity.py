"""Robots' identities: tokens, certificates, and what was proven on a link."""

from __future__ import annotations

from dataclasses import dataclass, field

__all__ = [
    "Admitted",
    "IdentityState",
    "IssuedCertificate",
    "NewCertificate",
    "Peer",
    "RobotIdentity",
    "TokenState",
]


@dataclass(frozen=True, slots=True)
class Peer:
    """What is known of a lane's other end before it speaks: the certificate (PEM) that it proved by TLS, if any, and
    whether it is on this very machine, with no proxy between. `address` stands for an IPv6 network's whole /64.
    """

    certificate: bytes | None = None
    local: bool = False
    address: str = ""


@dataclass(frozen=True, slots=True)
class Admitted:
    """Who may open a lane: a robot, and the certificate it proved to hold; `serial` is "" for one without identity.

    `issuer` is the key that signed it.
    """

    robot: str
    serial: str = ""
    not_after_ns: int = 0
    issuer: str = ""
    not_before_ns: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class NewCertificate:
    """A certificate that was made and is not stored yet; `key_hash` is the SHA-256 of its public key."""

    robot: str
    serial: str
    key_hash: str
    not_after_ns: int
    pem: str


@dataclass(frozen=True, slots=True, kw_only=True)
class IssuedCertificate:
    """One certificate of a robot, as people see it. `how`: token, renewal or grace."""

    serial: str
    how: str
    issued_ns: int
    not_after_ns: int
    revoked_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotIdentity:
    """A robot's identity, as people see it; `revoked_ns` and `alarm_ns` of 0: it is not, there is none."""

    robot: str
    enrolled_ns: int
    revoked_ns: int
    reason: str
    alarm: str
    alarm_ns: int
    certificates: tuple[IssuedCertificate, ...] = ()


@dataclass(frozen=True, slots=True)
class IdentityState:
    """What a link has to know of an identity."""

    robot: str
    revoked_ns: int
    reason: str
    revoked_serials: frozenset[str] = field(default_factory=frozenset)
    enrolled_ns: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class TokenState:
    """An enrolment token without its secret; `robot` is "" for any robot, `used_ns` 0 while nobody used it."""

    id: str
    robot: str
    made_by: str
    made_ns: int
    expires_ns: int
    used_ns: int
    used_robot: str
