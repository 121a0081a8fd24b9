"""Bundles of nodes on the robot's disk: fetched, checked, each with its environment, in a folder that never changes.

`bundles/NAME/VERSION` is complete once `complete.json` is in it. `bundle.json` in it says to whom runs it what there
is. Nothing of a folder changes afterwards, so it may be used by a node while its next version is fetched.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from edge_agent.update.container import find_engine, forget_image, load_image
from edge_agent.update.daemon import in_daemon
from edge_agent.update.environment import make_environment
from edge_agent.update.errors import SlotError, UpdateOffError
from edge_agent.update.files import read_table, remove_file, replace_table, sync_all
from edge_agent.update.slots import COMPLETE, python_of
from edge_agent.update.source import Source
from metaros.fleet.bundle import BundleError, Manifest, target_path
from metaros.limits import LIMITS

__all__ = ["NodeBundle", "NodeBundles"]

FACTS = "bundle.json"


@dataclass(frozen=True, slots=True)
class NodeBundle:
    """A bundle on the disk. `argv` runs it: with the environment's Python, or the command of the bundle itself. A
    container has none: `engine` runs `image`.
    """

    name: str
    version: str
    folder: Path
    argv: tuple[str, ...]
    engine: str = ""
    image: str = ""


class NodeBundles:
    """The folder `bundles` of the state directory. One event loop owns it; `directory_of` may be called by anybody."""

    def __init__(self, state_dir: Path, source: Callable[[], Source | None]) -> None:
        self._folder = state_dir / "bundles"
        self._source = source

    def directory_of(self, name: str, version: str) -> Path | None:
        """The folder of a complete bundle; None where there is none."""
        found = self.ready(name, version)
        return found.folder if found is not None else None

    def ready(self, name: str, version: str) -> NodeBundle | None:
        """A complete bundle, if it is here.

        Raises:
            UpdateFloorError: below the minimum version, even where it is on the disk already.
            BundleError: that is no name and version.
        """
        folder, source = self._place(name, version), self._source()
        if source is not None:
            source.minimum.check(name, version)
        if read_table(folder / COMPLETE).get("version") != version:
            return None
        facts = read_table(folder / FACTS)
        argv = facts.get("argv")
        if not isinstance(argv, list) or not all(isinstance(word, str) for word in argv):
            return None
        engine, image = (str(facts.get(key, "")) for key in ("engine", "image"))
        return NodeBundle(name, version, folder, tuple(argv), engine, image)

    async def get(self, name: str, version: str) -> NodeBundle:
        """The bundle, fetched where it is not here yet.

        Raises:
            UpdateError: it is not to be had, or not to be trusted.
            BundleError: that is no name and version of a bundle.
        """
        found = self.ready(name, version)
        return found if found is not None else await in_daemon(lambda: self.install(name, version))

    def install(self, name: str, version: str) -> NodeBundle:
        """The same, blocking, whatever is here."""
        source = self._source()
        if source is None:
            raise UpdateOffError("this robot is not enrolled, and takes no bundles")
        folder = self._place(name, version)
        with source.bundle("node", name, version) as fetched:
            if (found := self.ready(name, version)) is not None:  # somebody else was first
                return found
            _empty(folder)
            manifest = source.unpack(fetched, folder, kind="node", name=name, version=version)
            engine = find_engine() if manifest.image else ""
            image = load_image(engine, folder / manifest.image) if engine else ""
            if manifest.entry:
                make_environment(folder)
            _describe(folder, manifest, engine=engine, image=image)
            replace_table(folder / COMPLETE, {"version": version, "min_version": manifest.min_version})
        ready = self.ready(name, version)
        if ready is None:
            raise SlotError(f"{folder} is not what was written there")
        return ready

    def did_well(self, name: str, version: str) -> None:
        """A node of it runs as it should: the minimum version that it sets counts. Raises SlotError."""
        source, found = self._source(), read_table(self._place(name, version) / COMPLETE).get("min_version", "")
        if source is not None and isinstance(found, str):
            source.minimum.raise_to(name, found)

    def collect(self, keep: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
        """Delete the oldest bundles beyond the number kept, but none of `keep`; which were deleted."""
        wanted, gone = set(keep), []
        here = sorted(
            ((path.stat().st_mtime_ns, path) for path in self._folder.glob("*/*") if path.is_dir()),
            key=lambda row: row[0],
        )
        spare = len(here) - LIMITS.node_bundles
        for _, path in here:
            what = (path.parent.name, path.name)
            if what not in wanted and spare > 0:
                facts = read_table(path / FACTS)
                remove_file(path / COMPLETE)
                if isinstance(facts.get("image"), str) and facts["image"] and isinstance(facts.get("engine"), str):
                    forget_image(facts["engine"], facts["image"])
                shutil.rmtree(path, ignore_errors=True)
                gone.append(what)
                spare -= 1
        return gone

    def _place(self, name: str, version: str) -> Path:
        """Where it is or would be. Raises BundleError, so that no name becomes another path."""
        target_path("node", name, version)
        return self._folder / name / version


def _empty(folder: Path) -> None:
    remove_file(folder / COMPLETE)
    try:
        if folder.exists():
            shutil.rmtree(folder)
        folder.mkdir(mode=0o700, parents=True)
    except OSError as error:
        raise SlotError(f"cannot empty {folder}: {error.strerror or error}") from error


def _describe(folder: Path, manifest: Manifest, *, engine: str, image: str) -> None:
    """`bundle.json`, and everything before it on the disk."""
    argv: list[str] = []
    if manifest.entry:
        module, _, function = manifest.entry.partition(":")
        code = f"import sys; from {module} import {function}; sys.exit({function}())"
        argv = [str(python_of(folder)), "-I", "-c", code]
    elif manifest.command:
        argv = [str(folder / manifest.command[0]), *manifest.command[1:]]
    facts = {
        "name": manifest.name,
        "version": manifest.version,
        "kind": "python" if manifest.entry else "container" if image else "command",
        "entry": manifest.entry,
        "command": list(manifest.command),
        "wheels": "wheels/",
        "python": str(python_of(folder).relative_to(folder)) if manifest.entry else "",
        "argv": argv,
        "engine": engine,
        "image": image,
    }
    try:
        if manifest.command:
            (folder / manifest.command[0]).chmod(0o700)  # a zip need not say that it is a program
        (folder / FACTS).write_text(json.dumps(facts, indent=1))
        sync_all(folder)
    except (OSError, BundleError) as error:
        raise SlotError(f"cannot write {folder / FACTS}: {error}") from error
