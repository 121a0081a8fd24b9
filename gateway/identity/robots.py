"""Admission of robots' links: identities are checked at each Hello and again every second.

The table in the database is the truth, and all of it that links need is kept in memory. So a revocation at any gateway
on the database reaches each within `POLL_S`, and links live on while the database is away: for so long as one that
others may write to as well may be unheard of. Then they end, and nobody is let in, as nobody knows who was revoked.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import secrets
from collections.abc import Awaitable, Callable

from cryptography import x509

from gateway.domain.identity import Admitted, IdentityState, Peer, RobotIdentity
from gateway.errors import IdentityError, StoreError, UnknownRobotError, UnprovenError
from gateway.identity.certificates.authorities import Authorities
from gateway.identity.certificates.ca import SKEW
from gateway.identity.certificates.parsing import RobotCertificate, load_certificate, read_robot
from gateway.store import Store
from gateway.store.accounts.identities import changed_identities, list_identities, raise_alarm, revoke_identity
from gateway.store.engine import StoreEngine
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.limits import LIMITS
from metaros.link.proof import NONCE_BYTES, link_statement, verify

__all__ = ["POLL_S", "RobotIdentities"]

log = logging.getLogger(__name__)

POLL_S = 1.0
SKEW_NS = round(SKEW.total_seconds()) * 1_000_000_000  # certificates begin so long before they are issued
ALARM_EVERY_S = 60.0
SHOWN_IDENTITIES = 100_000
MAX_CERTIFICATES = 4
# How long an agent stays away that was refused: a person has to do something about all but the first two.
RETRY_MS = {"certificate_expired": 200, "proof_refused": 5_000, "not_enrolled": 30_000, "unsettled": 5_000}
RETRY_ELSE_MS = 60_000

Ask = Callable[[link_pb2.Challenge], Awaitable[bytes]]


class RobotIdentities:
    """Admits links, and lists identities for people."""

    def __init__(self, store: Store, authorities: Authorities, *, clock: Clock, required: bool) -> None:
        """`required`: no robot gets in without an identity, whether its name is known or not."""
        self._store = store
        self._authorities = authorities
        self._clock = clock
        self._required = required
        self._known: dict[str, IdentityState] = {}
        self._revision = 0
        self._alarmed_s: dict[str, float] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        self._failed = False
        self._looked_s = -POLL_S
        self._read_s = clock.monotonic_s()

    async def refresh(self) -> bool:
        """Learn what changed; whether anything did. StoreError when the database cannot be asked."""

        def job(engine: StoreEngine) -> tuple[int, list[IdentityState]]:
            with engine.transaction(write=False):
                return changed_identities(engine, self._revision)

        asked_s = self._clock.monotonic_s()
        revision, changed = await self._store.read(job)
        self._read_s = max(self._read_s, asked_s)
        self._known.update((state.robot, state) for state in changed)
        self._revision = max(self._revision, revision)
        return bool(changed)

    async def run(self, recheck: Callable[[], None]) -> None:
        """Look every `POLL_S` and let `recheck` check every open link; until cancelled."""
        while True:
            await asyncio.sleep(POLL_S)
            try:
                await self.refresh()
                self._failed = False
            except StoreError as error:
                if not self._failed:
                    log.warning("robots' identities cannot be read now; those known before still count: %s", error)
                self._failed = True
            recheck()

    async def admit(self, hello: link_pb2.Hello, peer: Peer, ask: Ask) -> Admitted:
        """Who opens this lane; where TLS has not proven it, `ask` sends a challenge and gives the signature it got.

        Raises:
            UnprovenError: it may not; with the code of the IdentityError behind it.
        """
        try:
            return await self._admit(hello, peer, ask)
        except IdentityError as error:
            raise UnprovenError(
                error.code, str(error), retry_after_ms=RETRY_MS.get(error.code, RETRY_ELSE_MS)
            ) from error

    def recheck(self, admitted: Admitted) -> None:
        """Whether who was admitted may stay; UnprovenError when the identity ended, or began, meanwhile."""
        try:
            self._check(admitted)
        except IdentityError as error:
            raise UnprovenError(
                error.code, str(error), retry_after_ms=RETRY_MS.get(error.code, RETRY_ELSE_MS)
            ) from error

    def enrolled_ns(self, robot: str) -> int | None:
        """When the identity began that the robot has now; 0 where it never had one, None where it was revoked."""
        state = self._known.get(robot)
        if state is None:
            return 0
        return None if state.revoked_ns else state.enrolled_ns

    def cloned(self, robot: str) -> None:
        """Two processes speak as this robot in turn: remember and say so, at most once a minute."""
        now_s = self._clock.monotonic_s()
        if robot not in self._known or now_s - self._alarmed_s.get(robot, -ALARM_EVERY_S) < ALARM_EVERY_S:
            return
        self._alarmed_s[robot] = now_s
        log.error("robot %s: two agents use one identity in turn: is there a copy of its disk?", robot)
        task = asyncio.get_running_loop().create_task(self._alarm(robot))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def revoke(self, robot: str, reason: str) -> None:
        """End a robot's identity, for good until a token made for it is used.

        Raises:
            UnknownRobotError: it has none.
        """
        now_ns = self._clock.wall_ns()
        changed = await self._store.run(lambda engine: revoke_identity(engine, robot, reason, now_ns=now_ns))
        await self.refresh()
        if not changed and robot not in self._known:
            raise UnknownRobotError(f"robot {robot[:64]!r} has no identity here")

    async def list(self) -> list[RobotIdentity]:
        """Every identity, by robot."""

        def job(engine: StoreEngine) -> list[RobotIdentity]:
            with engine.transaction(write=False):
                return list_identities(engine, limit=SHOWN_IDENTITIES)

        return await self._store.read(job)

    async def _admit(self, hello: link_pb2.Hello, peer: Peer, ask: Ask) -> Admitted:
        if peer.certificate is None and not hello.certificates:
            return self._without(hello.robot_id, peer)
        if len(hello.certificates) > MAX_CERTIFICATES:
            raise IdentityError("certificate_foreign", f"a Hello has at most {MAX_CERTIFICATES} certificates")
        shown = load_certificate(peer.certificate if peer.certificate is not None else hello.certificates[0])
        read = await self._read(shown)
        if read.robot != hello.robot_id:
            text = f"the certificate is that of {read.robot}, not of {hello.robot_id[:64]!r}"
            raise IdentityError("certificate_foreign", text)
        admitted = Admitted(read.robot, read.serial, read.not_after_ns, read.issuer, read.not_before_ns)
        await self._know(admitted)
        if peer.certificate is None:
            await self._prove(hello, read, ask)
        try:
            self._check(admitted)
        except IdentityError:
            await self._look()  # it may have been enrolled again a moment ago
            self._check(admitted)
        return admitted

    def _without(self, robot: str, peer: Peer) -> Admitted:
        """A robot that shows nothing: on this very machine it may, unless all have to be enrolled."""
        if self._required or not peer.local:
            raise IdentityError("not_enrolled", f"robot {robot[:64]!r} has to be enrolled: `metaros agent enrol`")
        admitted = Admitted(robot)
        self._check(admitted)
        return admitted

    async def _read(self, shown: x509.Certificate) -> RobotCertificate:
        """The certificate of a robot; an issuer that another gateway made just now is looked up."""
        known = self._authorities.issuers
        fleet, now_ns = self._authorities.fleet, self._clock.wall_ns()
        try:
            return read_robot(shown, known, fleet=fleet, now_ns=now_ns)
        except IdentityError as error:
            if error.code != "certificate_foreign" or not await self._looked_again():
                raise
        return read_robot(shown, self._authorities.issuers, fleet=fleet, now_ns=now_ns)

    async def _looked_again(self) -> bool:
        """Whether there are issuers now that there were not; strangers make nobody look more than once a second."""
        before, now_s = len(self._authorities.issuers), self._clock.monotonic_s()
        if now_s - self._looked_s < POLL_S:
            return False
        self._looked_s = now_s
        try:
            await self._authorities.load()
        except StoreError:
            return False
        return len(self._authorities.issuers) != before

    async def _look(self) -> None:
        """Learn what changed, if the database can be asked."""
        with contextlib.suppress(StoreError):
            await self.refresh()

    async def _know(self, admitted: Admitted) -> None:
        """An identity that another gateway made a moment ago."""
        if admitted.robot in self._known:
            return
        try:
            await self.refresh()
        except StoreError as error:
            raise IdentityError("not_enrolled", f"the identity of {admitted.robot} cannot be looked up now") from error
        if admitted.robot not in self._known:
            raise IdentityError("certificate_foreign", f"robot {admitted.robot} has no identity here any more")

    async def _prove(self, hello: link_pb2.Hello, shown: RobotCertificate, ask: Ask) -> None:
        nonce, audience = secrets.token_bytes(NONCE_BYTES), self._authorities.fleet
        signature = await ask(link_pb2.Challenge(nonce=nonce, audience=audience))
        statement = link_statement(
            nonce,
            audience=audience,
            robot_id=hello.robot_id,
            session_id=hello.session_id,
            session_number=hello.session_number,
            lane=hello.lane,
        )
        if not verify(shown.key, statement, signature):
            raise IdentityError("proof_refused", f"the proof is not signed by the key of {shown.robot}'s certificate")

    def _check(self, admitted: Admitted) -> None:
        if self._store.shared and self._clock.monotonic_s() - self._read_s > LIMITS.identities_stale_s:
            raise IdentityError("unsettled", "the database is away: nobody here knows who was revoked meanwhile")
        state = self._known.get(admitted.robot)
        if not admitted.serial:
            if state is not None:
                raise IdentityError("not_enrolled", f"robot {admitted.robot} has an identity and has to show it")
            return
        if state is not None and (state.revoked_ns or admitted.serial in state.revoked_serials):
            reason = f": {state.reason}" if state.reason else ""
            raise IdentityError("certificate_revoked", f"the identity of robot {admitted.robot} was revoked{reason}")
        if self._clock.wall_ns() >= admitted.not_after_ns:
            raise IdentityError("certificate_expired", f"the certificate of {admitted.robot} has come to its end")
        if admitted.issuer and not self._authorities.recognises(admitted.issuer):
            raise IdentityError("certificate_expired", f"the issuer of {admitted.robot}'s certificate was retired")
        # A moment that is still to come was said by another machine's clock: until then no certificate would do.
        if admitted.not_before_ns + SKEW_NS < self._authorities.renew_before_ns <= self._clock.wall_ns():
            raise IdentityError("certificate_expired", f"the certificate of {admitted.robot} is to be renewed now")

    async def _alarm(self, robot: str) -> None:
        now_ns = self._clock.wall_ns()
        try:
            await self._store.run(
                lambda engine: raise_alarm(engine, robot, "two agents use its identity in turn", now_ns=now_ns)
            )
        except StoreError as error:
            log.warning("the alarm of robot %s was not stored: %s", robot, error)
