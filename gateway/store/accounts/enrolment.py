"""Tokens and certificates in the database: a token is compared and burnt in the transaction that makes the identity.

Every function runs inside a writing transaction of the caller's. A refusal that must leave a mark (an alarm) is
returned, not raised: raising would take the mark back.
"""

from __future__ import annotations

import hmac
from collections.abc import Sequence
from dataclasses import dataclass

from gateway.domain.identity import NewCertificate, TokenState
from gateway.errors import IdentityError, TooManyError
from gateway.store.accounts.identities import next_revision, raise_alarm
from gateway.store.engine import Row, StoreEngine

__all__ = [
    "RETRY_S",
    "Outcome",
    "add_token",
    "check_token",
    "enrol_robot",
    "list_tokens",
    "remove_token",
    "renew_certificate",
]

RETRY_S = 600.0  # how long an answer that was lost may be asked for again, with the same key
SKEW_S = 300.0  # how far the clocks of two gateways may be apart
KEPT_S = 60 * 86_400.0  # how long tokens and certificates stay after their end, for people to look at


@dataclass(frozen=True, slots=True)
class Outcome:
    """A certificate in PEM, fresh or that of an earlier try; or why there is none."""

    pem: str = ""
    fresh: bool = True
    refused: IdentityError | None = None


def add_token(engine: StoreEngine, token: TokenState, secret_hash: str, *, now_ns: int, most: int) -> None:
    """Store a token; TooManyError when there are `most` that nobody used yet. Those long over are forgotten."""
    engine.execute("DELETE FROM enrolment_tokens WHERE expires_ns < ?", now_ns - round(KEPT_S * 1e9))
    waiting = engine.fetch("SELECT count(*) FROM enrolment_tokens WHERE used_ns = 0 AND expires_ns > ?", now_ns)
    if int(waiting[0][0]) >= most:
        raise TooManyError(f"{most} enrolment tokens wait for their robots already")
    engine.execute(
        "INSERT INTO enrolment_tokens VALUES (?, ?, ?, ?, ?, ?, 0, '', '')",
        token.id,
        secret_hash,
        token.robot,
        token.made_by,
        token.made_ns,
        token.expires_ns,
    )


def list_tokens(engine: StoreEngine, *, limit: int) -> list[TokenState]:
    """The newest tokens, without their secrets."""
    sql = (
        "SELECT token, robot, made_by, made_ns, expires_ns, used_ns, used_robot FROM enrolment_tokens"
        " ORDER BY made_ns DESC, token LIMIT ?"
    )
    return [
        TokenState(
            id=row[0],
            robot=row[1],
            made_by=row[2],
            made_ns=row[3],
            expires_ns=row[4],
            used_ns=row[5],
            used_robot=row[6],
        )
        for row in engine.fetch(sql, limit)
    ]


def remove_token(engine: StoreEngine, token_id: str) -> bool:
    """Take back a token that nobody used; False when there is none."""
    return bool(engine.execute("DELETE FROM enrolment_tokens WHERE token = ? AND used_ns = 0", token_id))


def enrol_robot(
    engine: StoreEngine, token_id: str, secret_hash: str, certificate: NewCertificate, *, now_ns: int
) -> Outcome:
    """Burn the token and give the robot its identity with this certificate.

    Of many at once exactly one burns it: the UPDATE compares and sets under the row's lock.

    Raises:
        IdentityError: the token is not good; nothing changed.
    """
    robot = certificate.robot
    burnt = engine.execute(
        "UPDATE enrolment_tokens SET used_ns = ?, used_robot = ?, used_key = ?"
        " WHERE token = ? AND secret_hash = ? AND used_ns = 0 AND made_ns <= ? AND expires_ns > ? AND robot IN ('', ?)",
        now_ns,
        robot,
        certificate.key_hash,
        token_id,
        secret_hash,
        now_ns + round(SKEW_S * 1e9),
        now_ns,
        robot,
    )
    if not burnt:
        return _second_try(engine, token_id, secret_hash, certificate, now_ns=now_ns)
    _make_identity(engine, token_id, robot, now_ns=now_ns)
    _store(engine, certificate, parent="", how="token", now_ns=now_ns)
    return Outcome(certificate.pem)


def check_token(engine: StoreEngine, token_id: str, secret_hash: str) -> None:
    """Whether there is such a token at all, used or not: strangers' guesses cost no signature and no writing.

    Raises:
        IdentityError: token_unknown.
    """
    rows = engine.fetch("SELECT secret_hash FROM enrolment_tokens WHERE token = ?", token_id)
    _check_secret(rows, secret_hash)


def renew_certificate(
    engine: StoreEngine, parent: str, certificate: NewCertificate, *, how: str, now_ns: int
) -> Outcome:
    """The successor of the certificate with the serial `parent`: this one, or that of an earlier try with the same key.

    A second key for one certificate is a copy of the robot's disk at work: refused, with an alarm.

    Raises:
        IdentityError: certificate_revoked, or certificate_foreign for a robot that has no identity here.
    """
    robot = certificate.robot
    rows = engine.fetch(f"SELECT revoked_ns FROM robot_identities WHERE robot = ?{engine.for_update}", robot)
    if not rows:
        raise IdentityError("certificate_foreign", f"robot {robot} has no identity here: it needs a token")
    old = engine.fetch("SELECT revoked_ns FROM certificates WHERE serial = ?", parent)
    if rows[0][0] or (old and old[0][0]):
        raise IdentityError("certificate_revoked", f"the identity of robot {robot} was revoked")
    if found := engine.fetch("SELECT key_hash, certificate FROM certificates WHERE parent = ?", parent):
        key_hash, pem = found[0]
        if key_hash == certificate.key_hash:
            return Outcome(pem, fresh=False)
        raise_alarm(engine, robot, "certificate renewed twice, with two keys", now_ns=now_ns)
        text = f"this certificate of {robot} was renewed before with another key: is there a copy of its disk?"
        return Outcome(refused=IdentityError("clone_detected", text))
    _store(engine, certificate, parent=parent, how=how, now_ns=now_ns)
    return Outcome(certificate.pem)


def _second_try(
    engine: StoreEngine, token_id: str, secret_hash: str, certificate: NewCertificate, *, now_ns: int
) -> Outcome:
    """Why the token was not burnt, or the certificate of the try whose answer was lost."""
    sql = (
        "SELECT secret_hash, robot, made_ns, expires_ns, used_ns, used_robot, used_key FROM enrolment_tokens"
        " WHERE token = ?"
    )
    rows = engine.fetch(sql, token_id)
    _check_secret(rows, secret_hash)
    _, robot, made_ns, expires_ns, used_ns, used_robot, used_key = rows[0]
    if robot not in ("", certificate.robot):
        raise IdentityError("token_foreign", f"the enrolment token is for another robot, not for {certificate.robot}")
    if not used_ns and made_ns > now_ns:
        raise IdentityError("token_expired", "the enrolment token is of a later time: the gateway's clock was set back")
    if not used_ns:
        raise IdentityError("token_expired", f"the enrolment token ended {_ago(now_ns - expires_ns)} ago")
    same = used_key == certificate.key_hash and used_robot == certificate.robot
    if same and now_ns - used_ns <= RETRY_S * 1e9:
        given = engine.fetch(
            "SELECT certificate FROM certificates WHERE robot = ? AND key_hash = ? AND parent = '' AND revoked_ns = 0",
            used_robot,
            used_key,
        )
        if given:
            return Outcome(given[0][0], fresh=False)
    if used_key != certificate.key_hash:
        raise_alarm(engine, used_robot, "its enrolment token was tried again, with another key", now_ns=now_ns)
    text = f"the enrolment token was used {_ago(now_ns - used_ns)} ago by robot {used_robot}"
    return Outcome(refused=IdentityError("token_used", text))


def _check_secret(rows: Sequence[Row], secret_hash: str) -> None:
    if not rows or not hmac.compare_digest(rows[0][0], secret_hash):
        raise IdentityError("token_unknown", "no such enrolment token: it was taken back, or is not of this gateway")


def _make_identity(engine: StoreEngine, token_id: str, robot: str, *, now_ns: int) -> None:
    """A new identity; or, with a token for this robot alone, a new beginning of the one it has."""
    revision = next_revision(engine)
    made = engine.execute(
        "INSERT INTO robot_identities VALUES (?, ?, 0, '', '', 0, ?) ON CONFLICT (robot) DO NOTHING",
        robot,
        now_ns,
        revision,
    )
    if made:
        return
    bound: Sequence[Sequence[str]] = engine.fetch("SELECT robot FROM enrolment_tokens WHERE token = ?", token_id)
    if bound[0][0] != robot:
        text = f"robot {robot} has an identity already: only a token made for it alone can replace that"
        raise IdentityError("token_foreign", text)
    engine.execute(  # first, as its lock makes a renewal that is under way end before its certificate is looked for
        "UPDATE robot_identities SET enrolled_ns = ?, revoked_ns = 0, reason = '', alarm = '', alarm_ns = 0,"
        " revision = ? WHERE robot = ?",
        now_ns,
        revision,
        robot,
    )
    engine.execute("UPDATE certificates SET revoked_ns = ? WHERE robot = ? AND revoked_ns = 0", now_ns, robot)


def _store(engine: StoreEngine, certificate: NewCertificate, *, parent: str, how: str, now_ns: int) -> None:
    over = now_ns - round(KEPT_S * 1e9)
    engine.execute("DELETE FROM certificates WHERE robot = ? AND not_after_ns < ?", certificate.robot, over)
    engine.execute(
        "INSERT INTO certificates VALUES (?, ?, ?, ?, ?, ?, ?, 0, ?)",
        certificate.serial,
        certificate.robot,
        certificate.key_hash,
        parent,
        how,
        now_ns,
        certificate.not_after_ns,
        certificate.pem,
    )


def _ago(span_ns: int) -> str:
    return f"{max(0, span_ns) // 60_000_000_000} min"
