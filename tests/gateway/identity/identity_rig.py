"""The gateway's identity managers on a store of a test, and a robot that knows how to enrol."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cryptography import x509
from cryptography.hazmat.primitives import serialization

from gateway.identity.certificates.authorities import Authorities
from gateway.identity.certificates.enrol import Enrolled, EnrolManager
from gateway.identity.robots import RobotIdentities
from gateway.store import Store
from gateway.store.retention import Retention
from metaros._proto import link_pb2
from metaros.clock import ManualClock, SystemClock
from metaros.link.proof import link_statement, renew_statement, sign
from tests.gateway.identity.robot_keys import ask, der, new_key

__all__ = ["DAY", "Held", "IdentityRig", "open_identity_rig", "opened_store"]

DAY = 86_400.0
FLEET = "fleet"


@dataclass
class Held:
    """What a robot has on its disk."""

    robot: str
    key: Any
    certificate: str

    @property
    def der(self) -> bytes:
        """Its certificate as it goes into a Hello."""
        return x509.load_pem_x509_certificate(self.certificate.encode()).public_bytes(serialization.Encoding.DER)

    @property
    def serial(self) -> str:
        """Its number."""
        return f"{x509.load_pem_x509_certificate(self.certificate.encode()).serial_number:x}"

    def hello(self, *, robot: str = "", lane: int = 1, number: int = 1) -> link_pb2.Hello:
        """A Hello that shows the certificate. Another number is another session, while the last one may still end."""
        return link_pb2.Hello(
            protocol=1,
            robot_id=robot or self.robot,
            session_id=b"s" * 16,
            session_number=number,
            lane=lane,
            namespace=f"/{self.robot}",
            certificates=[self.der],
        )

    def prove(self, hello: link_pb2.Hello, challenge: link_pb2.Challenge, *, key: Any = None) -> bytes:
        """The signature that answers a challenge."""
        statement = link_statement(
            challenge.nonce,
            audience=challenge.audience,
            robot_id=hello.robot_id,
            session_id=hello.session_id,
            session_number=hello.session_number,
            lane=hello.lane,
        )
        return sign(key or self.key, statement)


@dataclass
class IdentityRig:
    """One gateway's."""

    store: Store
    authorities: Authorities
    enrol: EnrolManager
    robots: RobotIdentities
    clock: ManualClock

    async def enrolled(self, robot: str = "arm", *, bound: bool = False) -> Held:
        """A robot with a token's certificate."""
        token, _ = await self.enrol.make_token(robot=robot if bound else "", made_by="ada")
        key = new_key()
        given = await self.enrol.enrol(token.text, robot, ask(key))
        await self.robots.refresh()
        return Held(robot, key, given.certificate)

    async def renewed(self, held: Held, *, key: Any = None, signed_by: Any = None, nonce: bytes = b"") -> Enrolled:
        """Renew it, with a new key."""
        nonce, csr = nonce or await self.enrol.challenge(), ask(key or new_key())
        statement = renew_statement(nonce, audience=FLEET, robot_id=held.robot, csr_der=der(csr))
        proof = sign(signed_by or held.key, statement)
        return await self.enrol.renew(held.robot, nonce=nonce, certificate=held.certificate, csr=csr, proof=proof)


@asynccontextmanager
async def opened_store(folder: Path, url: str) -> AsyncIterator[Store]:
    """A store that is closed at the end."""
    retention = Retention(age_s=100.0, size_bytes=1 << 30)
    store = Store(folder, clock=SystemClock(), retention=retention, queue_bytes=1 << 20, url=url)
    store.start()
    try:
        yield store
    finally:
        await store.close()


@asynccontextmanager
async def open_identity_rig(
    folder: Path, url: str, *, required: bool = False, **options: Any
) -> AsyncIterator[IdentityRig]:
    """The identity managers of a gateway whose data directory is `folder`; its clock stands still."""
    clock = ManualClock(wall_ns=SystemClock().wall_ns())
    async with opened_store(folder, url) as store:
        authorities = Authorities(store, folder, fleet=FLEET, clock=clock, **options)
        await authorities.load()
        robots = RobotIdentities(store, authorities, clock=clock, required=required)
        await robots.refresh()
        yield IdentityRig(store, authorities, EnrolManager(store, authorities, clock=clock, life_s=DAY), robots, clock)
