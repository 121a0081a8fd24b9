"""The background task that renews the certificate before it expires, and stores the new identity."""

from __future__ import annotations

import asyncio
import logging
import random  # noqa: TID251 - the type only; the generator is an argument
from pathlib import Path

from edge_agent.errors import EnrolError, EnrolRefusedError, IdentityFileError
from edge_agent.identity.certificate import validity_of
from edge_agent.identity.credentials import Credentials
from edge_agent.identity.enrol import renew
from edge_agent.identity.renewal import Renewal
from metaros.clock import Clock

__all__ = ["RenewalTask"]

LOG = logging.getLogger("metaros.agent.identity")
# Asking again brings nothing but a new token does.
HOPELESS = frozenset({"certificate_revoked", "clone_detected", "certificate_foreign"})


class RenewalTask:
    """Renews `credentials` in place, and on the disk."""

    def __init__(self, credentials: Credentials, state_dir: Path, clock: Clock, rng: random.Random) -> None:
        self._credentials = credentials
        self._state_dir = state_dir
        self.rule = Renewal(validity_of(credentials.identity.certificate), clock, rng)
        self._kick = asyncio.Event()
        self._said = ""

    def now(self) -> None:
        """The gateway holds the certificate for expired, whatever our clock says."""
        self._kick.set()

    async def run(self) -> None:
        """Until cancelled."""
        while True:
            await self._due()
            await self.attempt()

    async def attempt(self) -> bool:
        """Ask once; whether there is a new certificate."""
        try:
            fresh = await asyncio.to_thread(renew, self._credentials.identity, self._state_dir)
        except (EnrolError, IdentityFileError) as error:
            self.rule.failed()
            self._say(error)
            return False
        self._credentials.identity = fresh
        self.rule.renewed(validity_of(fresh.certificate))
        self._said = ""
        LOG.info("the certificate of %s was renewed", fresh.robot)
        return True

    async def _due(self) -> None:
        """Until the rule says so, or the gateway does."""
        while True:
            wait_s = self.rule.wait_s()
            if wait_s <= 0 and self.rule.state != "fresh":
                self._kick.clear()
                return
            try:
                async with asyncio.timeout(wait_s):
                    await self._kick.wait()
            except TimeoutError:
                continue
            self._kick.clear()
            if self.rule.may_ask():
                return

    def _say(self, error: EnrolError | IdentityFileError) -> None:
        text = f"the certificate is not renewed: {error}"
        if isinstance(error, EnrolRefusedError) and error.reason in HOPELESS:
            text += "; enrol the robot again with a new token"
        if text != self._said:
            LOG.warning("%s", text)
            self._said = text
