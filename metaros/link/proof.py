"""What a robot signs to show that it holds its key: one statement a purpose, the same bytes on both sides.

Each begins with its purpose, so that a signature made for one can never be shown for the other.
"""

from __future__ import annotations

import hashlib

__all__ = ["NONCE_BYTES", "link_statement", "renew_statement"]

NONCE_BYTES = 32

_LINK = b"metaros link 1\0"
_RENEW = b"metaros renew 1\0"


def link_statement(nonce: bytes, *, session_id: bytes, session_number: int, lane: int, robot_id: str) -> bytes:
    """The answer to a Challenge on one lane: it holds for this nonce, session, lane and robot alone.

    `nonce` has 32 bytes and `session_id` 16, so the fields cannot run into each other. Raises ValueError.
    """
    if len(nonce) != NONCE_BYTES or len(session_id) != 16:
        raise ValueError("a challenge has 32 bytes and a session id 16")
    return b"".join(
        (_LINK, nonce, session_id, session_number.to_bytes(8, "big"), lane.to_bytes(4, "big"), robot_id.encode())
    )


def renew_statement(nonce: bytes, *, csr_der: bytes, robot_id: str) -> bytes:
    """The old key's word for a certificate request with a new one. Raises ValueError for a nonce of another size."""
    if len(nonce) != NONCE_BYTES:
        raise ValueError("a challenge has 32 bytes")
    return _RENEW + nonce + hashlib.sha256(csr_der).digest() + robot_id.encode()
