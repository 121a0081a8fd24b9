"""Robots' identities as one feature: the authority, enrolment, admission of links, the servers' certificate."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from gateway.errors import AuthorityError, StoreError
from gateway.identity.certificates.authorities import Authorities
from gateway.identity.certificates.ca import ServerPair, issue_server
from gateway.identity.certificates.enrol import EnrolManager
from gateway.identity.robots import RobotIdentities
from gateway.store import Store
from metaros.clock import Clock
from metaros.errors import ConfigError

__all__ = ["IdentityChoices", "IdentityManager"]

log = logging.getLogger(__name__)

FLEET_CHARS = 12
FOLLOW_S = 2.0  # how often the authorities are read again: metaros ca, and other gateways, change them
PAIR_EVERY_S = 3600.0  # how often the servers' pair is looked at
PAIR_LEFT_NS = 30 * 86_400_000_000_000  # with less left there is a new one


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentityChoices:
    """What the settings say of robots' identities; `fleet` of "" is the store's own name."""

    fleet: str = ""
    required: bool = False
    certificate_s: float = 7 * 86_400.0
    ca_cert: Path | None = None
    ca_key: Path | None = None
    master_key: Path | None = None  # None: the data directory's


class IdentityManager:
    """Owns the parts; `enrol` makes certificates, `robots` is the gate."""

    def __init__(self, store: Store, data_dir: Path, choices: IdentityChoices, *, clock: Clock) -> None:
        """ConfigError when a supplied authority cannot issue."""
        self.fleet = choices.fleet or store.store_id[:FLEET_CHARS]
        self._clock = clock
        self.authorities = Authorities(
            store,
            data_dir,
            fleet=self.fleet,
            clock=clock,
            ca_cert=choices.ca_cert,
            ca_key=choices.ca_key,
            master_key=choices.master_key,
        )
        self.enrol = EnrolManager(store, self.authorities, clock=clock, life_s=choices.certificate_s)
        self.robots = RobotIdentities(store, self.authorities, clock=clock, required=choices.required)
        self._names: tuple[str, ...] = ()
        self._pair: ServerPair | None = None
        self._pair_by = ""  # the issuer of the pair

    @property
    def pair(self) -> ServerPair | None:
        """What the gateway's TLS servers show now; None before `serve_as`."""
        return self._pair

    async def start(self) -> None:
        """Know authorities and identities, so that the first Hello is judged by all of them."""
        await self.authorities.load()
        await self.robots.refresh()

    async def serve_as(self, names: Sequence[str]) -> ServerPair:
        """Make the certificate of the gateway's own TLS servers, under these host names and addresses.

        Raises:
            ConfigError: this gateway cannot issue one.
        """
        try:
            authority = await self.authorities.issuing()
        except AuthorityError as error:
            raise ConfigError(f"no certificate for this gateway's own TLS: {error}") from error
        self._names, self._pair_by = tuple(names), authority.id
        self._pair = issue_server(authority, self._names, now_ns=self._clock.wall_ns())
        return self._pair

    async def run(self, recheck: Callable[[], None]) -> None:
        """Watch identities, and follow the servers' pair in time; until cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self.robots.run(recheck))
            group.create_task(self._follow_pair())
            group.create_task(self._follow_authorities())

    async def _follow_authorities(self) -> None:
        """Another issuer: the servers' pair is its work from then on. A trouble is told once, until it is over."""
        last_error = ""
        while True:
            await asyncio.sleep(FOLLOW_S)
            try:
                await self.authorities.follow()
                if self._pair is not None and self._pair_by != self.authorities.current_id:
                    await self.serve_as(self._names)
                last_error = ""
            except (ConfigError, StoreError) as error:
                if str(error) != last_error:
                    log.warning("the fleet's authorities cannot be followed now: %s", error)
                last_error = str(error)

    async def _follow_pair(self) -> None:
        while True:
            await asyncio.sleep(PAIR_EVERY_S)
            if self._pair is None or self._pair.not_after_ns - self._clock.wall_ns() > PAIR_LEFT_NS:
                continue
            try:
                await self.serve_as(self._names)
            except (ConfigError, StoreError) as error:
                log.error("the gateway's own certificate ends soon and cannot be followed by another: %s", error)
