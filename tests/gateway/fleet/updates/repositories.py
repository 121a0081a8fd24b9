"""A repository on a real store, the people's folder beside it, and a robot that fetches with tuf's own client."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from tuf.api.exceptions import DownloadHTTPError
from tuf.ngclient import FetcherInterface, Updater

from gateway.fleet.updates import offline
from gateway.fleet.updates.publish import Upload
from gateway.fleet.updates.repository import Repository
from gateway.identity.master import MasterKey
from gateway.store import Store
from gateway.store.fleet.updates import StoredBundle
from gateway.store.objects import DirectoryStore
from gateway.store.retention import Retention
from metaros.clock import Clock, SystemClock
from metaros.errors import MetarosError
from metaros.limits import LIMITS, Limits
from tests.support.deployment.bundles import make_bundle

SECRET = b"correct horse"
KEY = bytes(range(32))


def passphrase(_name: str) -> bytes:
    """The same for every key."""
    return SECRET


@asynccontextmanager
async def repository(
    folder: Path,
    url: str = "",
    *,
    clock: Clock | None = None,
    key: bytes = KEY,
    objects: Path | None = None,
    limits: Limits = LIMITS,
) -> AsyncIterator[Repository]:
    """A gateway's repository; several may share `url` and `objects`."""
    clock = clock or SystemClock()
    stored = DirectoryStore(objects or folder / "objects")
    store = Store(
        folder, clock=clock, retention=Retention(age_s=100.0, size_bytes=1 << 30), queue_bytes=1 << 20, url=url
    )
    store.start()
    made = Repository(store, stored, MasterKey(key), folder / "incoming", clock=clock, limits=limits)
    made.uploads.clean()
    try:
        yield made
    finally:
        made.close()
        await store.close()


async def upload(made: Repository, path: Path, *, group: str = "") -> StoredBundle:
    """A bundle in pieces of no round size."""
    data = await asyncio.to_thread(path.read_bytes)

    async def pieces() -> AsyncIterator[bytes]:
        for start in range(0, len(data), 777):
            yield data[start : start + 777]

    return await made.uploads.take(pieces(), group=group, by="test")


async def publish_folder(made: Repository, people: Path) -> dict[str, int]:
    """All that `metaros update publish` does."""
    found = offline.release(people)
    for path, bundle in found.bundles.items():
        await upload(made, bundle, group=path.split("/")[1] if path.startswith("robots/") else "")
    return await made.publish(Upload(roots=found.roots, targets=found.targets, groups=found.groups))


async def set_up(made: Repository, people: Path, *versions: str, now_ns: int | None = None) -> dict[str, int]:
    """A root, and these versions of lidar-node signed and published."""
    now_ns = SystemClock().wall_ns() if now_ns is None else now_ns
    offline.init_root(people, await made.online_keys(), passphrase, now_ns=now_ns)
    return await ship(made, people, *versions, now_ns=now_ns)


async def ship(made: Repository, people: Path, *versions: str, now_ns: int | None = None) -> dict[str, int]:
    """Add, sign and publish further versions."""
    now_ns = SystemClock().wall_ns() if now_ns is None else now_ns
    for version in versions:
        offline.add(people, make_bundle(people.parent / "made", version=version))
    offline.sign_role(people, "targets", passphrase, now_ns=now_ns)
    return await publish_folder(made, people)


class Fetcher(FetcherInterface):
    """What a robot's HTTP client would get of the gateway."""

    def __init__(self, made: Repository, loop: asyncio.AbstractEventLoop) -> None:
        super().__init__()
        self._made = made
        self._loop = loop
        self.asked: list[str] = []

    def _fetch(self, url: str) -> Iterator[bytes]:
        self.asked.append(url)
        return iter([asyncio.run_coroutine_threadsafe(self._get(url), self._loop).result(60)])

    async def _get(self, url: str) -> bytes:
        kind, _, name = url.removeprefix("http://gateway/").partition("/")
        try:
            if kind == "metadata":
                return (await self._made.metadata(name)).document
            fetch = self._made.fetch(await self._made.target(name))
            try:
                return b"".join([piece async for piece in fetch.pieces()])
            finally:
                fetch.close()
        except MetarosError as error:
            raise DownloadHTTPError(str(error), 404) from error


class Robot:
    """Tuf's client with its own directory."""

    def __init__(self, folder: Path, made: Repository, root: bytes) -> None:
        self._folder = folder
        self._root = root
        for each in (folder / "metadata", folder / "targets"):
            each.mkdir(parents=True, exist_ok=True)
        self.fetcher = Fetcher(made, asyncio.get_running_loop())

    async def get(self, path: str) -> bytes | None:
        """The verified bytes of a target; None when no target has that path."""
        return await asyncio.to_thread(self._get, path)

    def _get(self, path: str) -> bytes | None:
        updater: Any = Updater(
            str(self._folder / "metadata"),
            "http://gateway/metadata/",
            str(self._folder / "targets"),
            "http://gateway/targets/",
            fetcher=self.fetcher,
            bootstrap=self._root,
        )
        updater.refresh()
        info = updater.get_targetinfo(path)
        return Path(updater.download_target(info)).read_bytes() if info is not None else None
