"""Enrolment tokens: one robot, one use, one hour. Only a hash of the secret is stored.

A token reads `mr1.ID.SECRET.PIN`. The pin is the hash of the fleet's root key: a robot that has the token needs no
other trust in whoever answers at the gateway's address, and sends the secret to nobody else.
"""

from __future__ import annotations

import hashlib
import re
import secrets
from dataclasses import dataclass, field

from gateway.errors import IdentityError

__all__ = ["Token", "make_token", "parse_token"]

_FORM = re.compile(r"mr1\.([0-9a-f]{12})\.([0-9a-f]{32})\.([A-Za-z0-9_-]{43})")


@dataclass(frozen=True, slots=True)
class Token:
    """A token's parts."""

    id: str
    secret: str = field(repr=False)
    pin: str

    @property
    def text(self) -> str:
        """What the robot is given."""
        return f"mr1.{self.id}.{self.secret}.{self.pin}"

    @property
    def secret_hash(self) -> str:
        """What is stored: 128 random bits need no slow hash."""
        return hashlib.sha256(self.secret.encode()).hexdigest()


def make_token(pin: str) -> Token:
    """A new token for the fleet whose root has that pin."""
    return Token(secrets.token_hex(6), secrets.token_hex(16), pin)


def parse_token(text: str) -> Token:
    """The parts of a token's text; IdentityError token_unknown when it is none."""
    found = _FORM.fullmatch(text.strip())
    if found is None:
        raise IdentityError("token_unknown", "that is no enrolment token: it looks like mr1.ID.SECRET.PIN")
    return Token(*found.groups())
