"""Where bundles come from: the signed repository of the gateway that enrolled the robot, one bundle at a time."""

from __future__ import annotations

import ssl
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from edge_agent.update.errors import UpdateFetchError
from edge_agent.update.minimum_version import MinimumVersions
from metaros.clock import Clock
from metaros.fleet.bundle import Manifest, target_path
from metaros.lazy_import import LazyModule

if TYPE_CHECKING:  # with all that checks signatures: an agent that fetches nothing must not wait for it at its start
    from edge_agent.update import bundle as bundles
    from edge_agent.update import fetch, repository
    from edge_agent.update.fetch import TransferLimits
    from edge_agent.update.repository import Fetched, SignedRepository
else:
    bundles = LazyModule("edge_agent.update.bundle")
    fetch, repository = LazyModule("edge_agent.update.fetch"), LazyModule("edge_agent.update.repository")

__all__ = ["API", "Source"]

API = "/api/v1/updates"
SHIPPED = "shipped_root.json"


class Source:
    """`url` is the gateway's, as at the enrolment. Methods block; one caller at a time is let in."""

    def __init__(
        self,
        folder: Path,
        url: str,
        tls: Callable[[], ssl.SSLContext],
        clock: Clock,
        *,
        groups: tuple[str, ...] = (),
        patience: TransferLimits | None = None,
    ) -> None:
        self.folder = folder
        self.minimum = MinimumVersions(folder)
        self.token = ""  # the newest that the gateway gave
        self._url = url.rstrip("/") + API
        self._tls = tls
        self._clock = clock
        self._groups = groups
        self._patience = patience
        self._turn = threading.Lock()

    @contextmanager
    def bundle(self, kind: str, name: str, version: str) -> Iterator[Fetched]:
        """That bundle, checked, on the disk while the block runs.

        Raises:
            UpdateError: it is not to be had, or not to be trusted.
            BundleError: that is no name and version of a bundle.
        """
        paths = [target_path(kind, name, version, group=group) for group in (*self._groups, "")]
        self.minimum.check(name, version)
        with self._turn:
            fetched = self._repository().fetch(paths)
            try:
                yield fetched
            finally:
                fetched.path.unlink(missing_ok=True)

    def unpack(self, fetched: Fetched, folder: Path, *, kind: str, name: str, version: str) -> Manifest:
        """All of it in an empty folder, if it is what was asked for. Raises UpdateError."""
        manifest = bundles.unpack(fetched, folder)
        bundles.check_target(manifest, kind=kind, name=name, version=version)
        return manifest

    def _repository(self) -> SignedRepository:
        try:
            tls = self._tls()
        except (OSError, ValueError) as error:
            raise UpdateFetchError(f"the fleet's root cannot be used: {error}") from error
        fetcher = fetch.RobotFetcher(
            tls, lambda: self.token, self.folder / "parts", self._clock, patience=self._patience
        )
        shipped = self.folder / SHIPPED
        return repository.SignedRepository(
            self.folder, self._url, fetcher, self._clock, shipped_root=shipped if shipped.exists() else None
        )
