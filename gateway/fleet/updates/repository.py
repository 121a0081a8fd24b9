"""The update repository of a store: what people signed, what the gateway signs after them, and the bundles.

Several gateways may share the store: each serves all of it, and one at a time, by a row of `duties`, signs snapshot and
timestamp again before they end. A gateway whose master key did not seal the online keys serves without signing.
"""

from __future__ import annotations

import asyncio
import logging
import re
from collections import Counter
from collections.abc import AsyncIterator, Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeVar

import orjson

from gateway.errors import StoreError, TooManyError
from gateway.fleet.updates.errors import UnknownUpdateError, UpdateRefusedError, WithdrawnError
from gateway.fleet.updates.publish import PURPOSE, Upload, publish, renew
from gateway.fleet.updates.roles import ONLINE, Seal, new_signer
from gateway.fleet.updates.uploads import BundleUploads
from gateway.store import Store
from gateway.store.engine import StoreEngine
from gateway.store.fleet.updates import (
    StoredBundle,
    StoredDocument,
    StoredKey,
    add_key,
    bundle_at,
    list_bundles,
    list_keys,
    lock_updates,
    newest_documents,
    read_document,
    take_duty,
    withdraw_bundle,
)
from gateway.store.objects import ObjectStore, chunks
from metaros.clock import Clock
from metaros.errors import MetarosError
from metaros.limits import LIMITS, Limits

__all__ = ["BundleDownload", "Repository"]

log = logging.getLogger(__name__)

Result = TypeVar("Result")
DUTY = "updates.renew"
LOOK_S = 30.0
DUTY_NS = 120 * 10**9
PIECE_BYTES = 1 << 20
_FILE = re.compile(r"(?:(\d{1,10})\.)?(root|targets|snapshot|timestamp|robots(?:/|%2[Ff])[a-z0-9-]{1,63})\.json")
_TARGET = re.compile(r"((?:[A-Za-z0-9_.-]+/){1,4})([0-9a-f]{64})\.([0-9.]{1,40}\.zip)")


class BundleDownload:
    """A bundle on its way to a robot; take `pieces()` once, and `close()` it whatever happens."""

    def __init__(self, repository: Repository, content: Iterator[bytes], *, robot: str) -> None:
        self._repository: Repository | None = repository
        self._robot = robot
        self._content = content
        self._pool = repository.pool

    async def pieces(self) -> AsyncIterator[bytes]:
        """Its bytes; one piece is in memory at a time."""
        loop = asyncio.get_running_loop()
        while piece := await loop.run_in_executor(self._pool, next, self._content, b""):
            yield piece

    def close(self) -> None:
        """Give its place to another."""
        repository, self._repository = self._repository, None
        if repository is not None:
            repository.fetched(self._robot)


class Repository:
    """Everything about update files that the API and the wiring need."""

    def __init__(
        self,
        store: Store,
        objects: ObjectStore,
        seal: Seal,
        folder: Path,
        *,
        clock: Clock,
        limits: Limits = LIMITS,
    ) -> None:
        """`folder`: where uploads lie until they are whole."""
        self._store = store
        self._objects = objects
        self._seal = seal
        self._clock = clock
        self._limits = limits
        self.uploads = BundleUploads(store, objects, folder, clock=clock, limits=limits)
        self.pool = ThreadPoolExecutor(max_workers=4, thread_name_prefix="update-fetch")
        self._fetching: Counter[str] = Counter()  # by robot
        self.trouble = ""

    def close(self) -> None:
        """End what robots fetch."""
        self.pool.shutdown(wait=False, cancel_futures=True)

    async def online_keys(self, *, fresh: bool = False) -> dict[str, Any]:
        """The public keys of the gateway's two roles, made at first use; `fresh`: a new pair, for the next root."""

        def job(engine: StoreEngine) -> dict[str, Any]:
            made = {role: new_signer() for role in ONLINE}
            lock_updates(engine)
            newest = {key.role: key for key in reversed(list_keys(engine))}
            for role, signer in made.items():
                if not fresh and role in newest:
                    continue
                public = signer.public_key
                newest[role] = StoredKey(
                    keyid=public.keyid,
                    role=role,
                    public_key=orjson.dumps(public.to_dict()).decode(),
                    sealed=self._seal.seal(PURPOSE, public.keyid, signer.private_bytes),
                    made_ns=self._clock.wall_ns(),
                )
                add_key(engine, newest[role])
            return {role: {"keyid": key.keyid, "key": orjson.loads(key.public_key)} for role, key in newest.items()}

        return await self._store.run(job)

    async def publish(self, upload: Upload) -> dict[str, int]:
        """Take signed documents; the newest version of each role. UpdateRefusedError: nothing was changed."""
        now_ns = self._clock.wall_ns()
        return await self._store.run(lambda engine: publish(engine, upload, self._seal, now_ns=now_ns))

    async def bundles(self) -> list[StoredBundle]:
        """Every bundle that was uploaded, the newest first."""
        return await self._read(lambda engine: list_bundles(engine, limit=self._limits.bundles))

    async def bundle(self, path: str) -> StoredBundle:
        """The bundle of a target path; UnknownUpdateError where there is none."""
        found = await self._read(lambda engine: bundle_at(engine, path))
        if found is None:
            raise UnknownUpdateError(f"there is no bundle {path[:120]!r}; GET /api/v1/updates lists them")
        return found

    async def documents(self) -> dict[str, StoredDocument]:
        """The newest document of every role."""
        return await self._read(newest_documents)

    async def signed(self) -> dict[str, str]:
        """SHA-256 of every target that the newest targets and groups hold, by path."""
        found = await self.documents()
        held: dict[str, str] = {}
        for role, one in found.items():
            if role == "targets" or role.startswith("robots/"):
                targets = orjson.loads(one.document)["signed"]["targets"]
                held |= {path: target["hashes"].get("sha256", "") for path, target in targets.items()}
        return held

    async def available(self, kind: str, name: str, version: str) -> bool:
        """Whether robots may be given this version: here, signed, not withdrawn."""
        signed = await self.signed()
        return any(
            (one.kind, one.name, one.version) == (kind, name, version)
            and not one.withdrawn_ns
            and signed.get(one.path) == one.sha256
            for one in await self.bundles()
        )

    async def withdraw(self, path: str, reason: str) -> StoredBundle:
        """Hand a version out no more; robots that run it keep it. UnknownUpdateError where there is none."""
        now_ns = self._clock.wall_ns()
        await self._store.run(lambda engine: withdraw_bundle(engine, path, reason, now_ns=now_ns))
        return await self.bundle(path)

    async def metadata(self, file: str) -> StoredDocument:
        """A signed document by its file's name, as robots ask: `timestamp.json`, `3.targets.json`."""
        match = _FILE.fullmatch(file)
        number = match[1] if match is not None else None
        if match is None or (number is None) != (match[2] == "timestamp"):
            raise UnknownUpdateError(f"there is no metadata {file[:80]!r}")
        role = re.sub("%2f", "/", match[2], flags=re.IGNORECASE)
        version = int(number) if number is not None else None
        found = await self._read(lambda engine: read_document(engine, role, version))
        if found is None:
            raise UnknownUpdateError(f"there is no metadata {file[:80]!r}")
        return found

    async def target(self, file: str) -> StoredBundle:
        """A bundle by the name under which robots ask for it, which holds its hash.

        Raises:
            UnknownUpdateError: there is none.
            WithdrawnError: there was.
        """
        match = _TARGET.fullmatch(file)
        path = f"{match[1]}{match[3]}" if match is not None else ""
        found = await self._read(lambda engine: bundle_at(engine, path))
        if found is None or match is None or found.sha256 != match[2]:
            raise UnknownUpdateError(f"there is no target {file[:120]!r}")
        if found.withdrawn_ns:
            raise WithdrawnError(f"{path} was withdrawn{f': {found.reason}' if found.reason else ''}")
        return found

    def fetch(
        self, bundle: StoredBundle, *, start: int = 0, size_bytes: int | None = None, robot: str = ""
    ) -> BundleDownload:
        """A range of a bundle for a robot; TooManyError while too many are fetched, by all or by this one."""
        if self._fetching.total() >= self._limits.bundle_downloads:
            raise TooManyError(f"{self._limits.bundle_downloads} bundles are being fetched: try again")
        if self._fetching[robot] >= self._limits.robot_downloads:
            raise TooManyError(f"{self._limits.robot_downloads} bundles are being fetched by {robot}: try again")
        self._fetching[robot] += 1
        content = chunks(self._objects, bundle.object, start=start, size_bytes=size_bytes, piece_bytes=PIECE_BYTES)
        return BundleDownload(self, content, robot=robot)

    def fetched(self, robot: str) -> None:
        """One of its downloads is over."""
        self._fetching[robot] -= 1
        if not self._fetching[robot]:
            del self._fetching[robot]

    async def renew(self) -> bool:
        """Sign again what ends soon, if it is this gateway's turn; whether anything was."""
        now_ns = self._clock.wall_ns()

        def job(engine: StoreEngine) -> bool:
            if not take_duty(engine, DUTY, self._store.gateway_id, now_ns=now_ns, for_ns=DUTY_NS):
                return False
            return renew(engine, self._seal, now_ns=now_ns)

        return await self._store.run(job)

    async def run(self) -> None:
        """Renew for ever; a trouble is told once, until it is over."""
        while True:
            try:
                await self.renew()
                self.trouble = ""
            except UpdateRefusedError as error:  # another gateway may hold the keys: this one lets it have the turn
                self._report(str(error))
            except (StoreError, MetarosError) as error:
                self._report(str(error))
            await asyncio.sleep(LOOK_S)

    async def _read(self, job: Callable[[StoreEngine], Result]) -> Result:
        def within(engine: StoreEngine) -> Result:
            with engine.transaction(write=False):
                return job(engine)

        return await self._store.read(within)

    def _report(self, text: str) -> None:
        if text != self.trouble:
            log.warning("update metadata cannot be signed again now: %s", text)
        self.trouble = text
