"""Enrolment and renewal: what a robot sends, checked in order, and the certificate that it gets.

A renewal is proven by the old key's signature over a challenge, so it needs no TLS with client certificates, passes
any proxy, and works for a while after the certificate's end too. Challenges are not remembered: each carries its time
and our mark. Showing one twice gains nothing, since the signature covers the one request for the one new key.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
from dataclasses import dataclass

from gateway.domain.identity import NewCertificate, TokenState
from gateway.domain.robot import is_robot_id
from gateway.errors import IdentityError, InvalidRequestError
from gateway.identity.certificates.authorities import Authorities
from gateway.identity.certificates.ca import Authority, issue_robot, key_pem, pem
from gateway.identity.certificates.parsing import RobotKey, check_csr, key_id, load_certificate, read_robot
from gateway.identity.certificates.tokens import Token, make_token, parse_token
from gateway.store import Store
from gateway.store.accounts.enrolment import (
    Outcome,
    add_token,
    check_token,
    enrol_robot,
    list_tokens,
    remove_token,
    renew_certificate,
)
from gateway.store.engine import StoreEngine
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits
from metaros.link.proof import NONCE_BYTES, renew_statement, verify

__all__ = ["CHALLENGE_S", "TOKEN_S", "EnrolManager", "Enrolled"]

TOKEN_S = 3600.0
CHALLENGE_S = 60.0
MARK_BYTES = 16
SHOWN_TOKENS = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class Enrolled:
    """What a robot gets, in PEM; `fresh` is False when it is the answer to an earlier, equal request."""

    robot: str
    certificate: str
    chain: str
    roots: str
    vouchers: str
    not_after_ns: int
    fresh: bool


class EnrolManager:
    """Makes tokens for people and certificates for robots."""

    def __init__(
        self, store: Store, authorities: Authorities, *, clock: Clock, life_s: float, limits: Limits = LIMITS
    ) -> None:
        """`life_s` is how long a robot's certificate is valid."""
        self._store = store
        self._authorities = authorities
        self._clock = clock
        self._life_s = life_s
        self._limits = limits

    async def make_token(self, *, robot: str = "", made_by: str, ttl_s: float = TOKEN_S) -> tuple[Token, TokenState]:
        """A token for one robot, or for any that has no identity; its secret is shown now and never again.

        Raises:
            InvalidRequestError: that is no robot id.
            TooManyError: too many tokens wait.
        """
        if robot:
            _check_robot(robot)
        authority, now_ns = await self._authorities.issuing(), self._clock.wall_ns()
        token = make_token(authority.pin)
        state = TokenState(
            id=token.id,
            robot=robot,
            made_by=made_by,
            made_ns=now_ns,
            expires_ns=now_ns + round(ttl_s * 1e9),
            used_ns=0,
            used_robot="",
        )
        most = self._limits.enrolment_tokens
        await self._store.run(lambda engine: add_token(engine, state, token.secret_hash, now_ns=now_ns, most=most))
        return token, state

    async def tokens(self) -> list[TokenState]:
        """The newest tokens, used and unused."""

        def job(engine: StoreEngine) -> list[TokenState]:
            with engine.transaction(write=False):
                return list_tokens(engine, limit=SHOWN_TOKENS)

        return await self._store.read(job)

    async def drop_token(self, token_id: str) -> bool:
        """Take back a token that nobody used; False when there is none."""
        return await self._store.run(lambda engine: remove_token(engine, token_id))

    async def enrol(self, text: str, robot: str, csr: str) -> Enrolled:
        """A robot's first certificate for its token.

        Raises:
            IdentityError: token_*, or csr_refused; the token is as good as before.
            AuthorityError: no certificate can be issued here now.
        """
        _check_robot(robot)
        token = parse_token(text)
        authority, now_ns = await self._authorities.issuing(), self._clock.wall_ns()
        if token.pin not in self._authorities.pins:
            raise IdentityError("token_foreign", "the enrolment token is of another fleet: ask at this gateway for one")
        await self._check_token(token)
        key, _ = check_csr(csr, fleet=self._authorities.fleet, robot=robot)
        made = self._issue(authority, key, robot, now_ns)
        outcome = await self._store.run(
            lambda engine: enrol_robot(engine, token.id, token.secret_hash, made, now_ns=now_ns)
        )
        return self._enrolled(robot, outcome)

    async def challenge(self) -> bytes:
        """What a renewal signs; good for `CHALLENGE_S`."""
        key = _challenge_key(await self._authorities.issuing())
        made = secrets.token_bytes(NONCE_BYTES - MARK_BYTES - 8) + self._clock.wall_ns().to_bytes(8, "big")
        return made + _mark(key, made)

    async def renew(self, robot: str, *, nonce: bytes, certificate: str, csr: str, proof: bytes) -> Enrolled:
        """The next certificate of a robot that proves to hold the old one's key.

        Raises:
            IdentityError: certificate_*, proof_refused, csr_refused, or clone_detected.
            AuthorityError: no certificate can be issued here now.
        """
        fleet, now_ns = self._authorities.fleet, self._clock.wall_ns()
        authority = await self._authorities.issuing()
        self._check_challenge(nonce, now_ns=now_ns)
        grace_s = self._limits.renewal_grace_s
        issuers = self._authorities.issuers
        old = read_robot(load_certificate(certificate), issuers, fleet=fleet, now_ns=now_ns, grace_s=grace_s)
        if old.robot != robot:
            raise IdentityError("certificate_foreign", f"the certificate is that of {old.robot}, not of {robot[:64]}")
        key, request = check_csr(csr, fleet=fleet, robot=robot)
        if not verify(old.key, renew_statement(nonce, audience=fleet, robot_id=robot, csr_der=request), proof):
            raise IdentityError("proof_refused", f"the renewal is not signed by the key of {robot}'s certificate")
        if key == old.key:
            raise IdentityError("csr_refused", "a renewal needs a new key")
        made = self._issue(authority, key, robot, now_ns)
        how = "renewal" if now_ns < old.not_after_ns else "grace"
        outcome = await self._store.run(
            lambda engine: renew_certificate(engine, old.serial, made, how=how, now_ns=now_ns)
        )
        return self._enrolled(robot, outcome)

    async def _check_token(self, token: Token) -> None:
        """That there is such a token, before anything is signed or written for whoever asks."""

        def job(engine: StoreEngine) -> None:
            with engine.transaction(write=False):
                check_token(engine, token.id, token.secret_hash)

        await self._store.read(job)

    def _check_challenge(self, nonce: bytes, *, now_ns: int) -> None:
        """It is ours, perhaps from before another issuer followed, and not old."""
        made, mark = nonce[:-MARK_BYTES], nonce[-MARK_BYTES:]
        ours = [_mark(_challenge_key(issuer), made) for issuer in self._authorities.opened]
        if len(nonce) != NONCE_BYTES or not any(hmac.compare_digest(mark, one) for one in ours):
            raise IdentityError("proof_refused", "the challenge is not one of this gateway's")
        if abs(now_ns - int.from_bytes(made[-8:], "big")) > CHALLENGE_S * 1e9:  # another gateway's clock may be ahead
            raise IdentityError("proof_refused", f"the challenge is older than {CHALLENGE_S:g} s: ask for a new one")

    def _issue(self, authority: Authority, key: RobotKey, robot: str, now_ns: int) -> NewCertificate:
        fleet = self._authorities.fleet
        made = issue_robot(authority, key, fleet=fleet, robot=robot, now_ns=now_ns, life_s=self._life_s)
        return NewCertificate(
            robot=robot,
            serial=f"{made.serial_number:x}",
            key_hash=key_id(key),
            not_after_ns=round(made.not_valid_after_utc.timestamp()) * 1_000_000_000,
            pem=pem(made),
        )

    def _enrolled(self, robot: str, outcome: Outcome) -> Enrolled:
        if outcome.refused is not None:
            raise outcome.refused
        leaf = load_certificate(outcome.pem)
        return Enrolled(
            robot=robot,
            certificate=outcome.pem,
            chain=self._authorities.chain_for(leaf),
            roots=self._authorities.roots_pem,
            vouchers=self._authorities.vouchers_pem,
            not_after_ns=round(leaf.not_valid_after_utc.timestamp()) * 1_000_000_000,
            fresh=outcome.fresh,
        )


def _check_robot(robot: str) -> None:
    if not is_robot_id(robot):
        text = "a robot id is 1 to 64 of letters, digits, '_', '.', '-', and starts with a letter or digit"
        raise InvalidRequestError(f"robot: {text}")


def _challenge_key(authority: Authority) -> bytes:
    """The same on every gateway that can issue, and known to nobody else."""
    if authority.key is None:
        raise ValueError("an authority without its key asks nobody for proofs")
    return hashlib.sha256(b"metaros challenge\0" + key_pem(authority.key)).digest()


def _mark(key: bytes, made: bytes) -> bytes:
    return hmac.new(key, made, hashlib.sha256).digest()[:MARK_BYTES]
