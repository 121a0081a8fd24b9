"""From a bare machine (Python >= 3.11, make, git) to a ready `.venv`: locked dependencies, this project, the dashboard.

Standard library only, because it runs before anything is installed. Run by `make setup`; does nothing when nothing
changed. Where Debian's python3-venv is missing it takes PyPI's virtualenv, if pip is there to fetch it.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
VENV = ROOT / ".venv"
BIN = VENV / ("Scripts" if os.name == "nt" else "bin")
PYTHON = BIN / ("python.exe" if os.name == "nt" else "python")
STATE = ROOT / ".make"
STAMP = STATE / "setup"
STATIC = ROOT / "gateway" / "static"

HASHED = ("--require-hashes", "-r")
EDITABLE = ("--no-deps", "--no-build-isolation", "-e", ".")
EDITABLE_ENV = {**os.environ, "METAROS_SKIP_DASHBOARD": "1"}

# (commands any of which does, what is left out without, Debian package): said in one line each, never fatal.
OPTIONAL = (
    (
        ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome"),
        "browser tests",
        "chromium-headless-shell",
    ),
    (("cc",), "tests of C structs", "gcc libc6-dev"),
    (("espeak-ng",), "tests of a speaker's texts", "espeak-ng"),
)


def say(text: str) -> None:
    """One line of progress."""
    print(f"metaros: {text}", flush=True)


def run(*command: str | Path, what: str, env: dict[str, str] | None = None) -> None:
    """Run a step quietly; on failure show its last lines and stop."""
    done = subprocess.run([str(part) for part in command], cwd=ROOT, env=env, capture_output=True, text=True)
    if done.returncode:
        sys.stderr.write("\n".join((done.stdout + done.stderr).strip().splitlines()[-25:]) + "\n")
        raise SystemExit(f"metaros: {what} failed (exit {done.returncode})")


def has_module(name: str) -> bool:
    """Whether the system's Python can import `name`."""
    return subprocess.run([sys.executable, "-c", f"import {name}"], capture_output=True).returncode == 0


def make_venv() -> None:
    """Make `.venv` with venv, else with virtualenv from PyPI; name the Debian package when neither can be."""
    if PYTHON.exists() and subprocess.run([str(PYTHON), "-m", "pip", "--version"], capture_output=True).returncode == 0:
        return
    shutil.rmtree(VENV, ignore_errors=True)
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    say(f"making .venv with Python {version}")
    if has_module("venv") and has_module("ensurepip"):
        run(sys.executable, "-m", "venv", VENV, what="venv")
    elif has_module("pip"):
        tool = STATE / "virtualenv"
        run(sys.executable, "-m", "pip", "install", "-q", "--target", tool, "virtualenv", what="fetching virtualenv")
        env = {**os.environ, "PYTHONPATH": str(tool)}
        run(sys.executable, "-m", "virtualenv", "-q", VENV, what="virtualenv", env=env)
    else:
        raise SystemExit("metaros: this Python has neither venv nor pip (Debian: apt install python3-venv)")


def fingerprint(paths: Sequence[Path]) -> str:
    """A hash of the files that decide what is installed."""
    digest = hashlib.sha256(sys.version.encode())
    for path in paths:
        digest.update(path.read_bytes())
    return digest.hexdigest()


def succeeds(*command: str | Path) -> bool:
    """Whether a command that has an alternative ends well."""
    words = [str(part) for part in command]
    return subprocess.run(words, cwd=ROOT, env=EDITABLE_ENV, capture_output=True).returncode == 0


def install_by_uv() -> bool:
    """What pip does in a quarter of its time; False where uv cannot, such as with an index that only pip knows."""
    pinned = re.search(r"^uv==.*(?:\n    .*)*", (ROOT / "requirements.lock").read_text(), re.MULTILINE)
    if pinned is None:
        return False
    (STATE / "uv.txt").write_text(pinned[0])
    pip = (PYTHON, "-m", "pip", "install", "-q", "--disable-pip-version-check")
    uv = (PYTHON, "-m", "uv", "pip", "install", "-q", "--python", PYTHON)
    return (
        succeeds(*pip, *HASHED, STATE / "uv.txt")
        and succeeds(*uv, *HASHED, "requirements.lock")
        and succeeds(*uv, *EDITABLE)
    )


def install_by_pip() -> None:
    """The lock and this project; what goes wrong ends the setup."""
    pip = (PYTHON, "-m", "pip", "install", "-q", "--disable-pip-version-check")
    run(*pip, *HASHED, "requirements.lock", what="installing requirements.lock")
    run(*pip, *EDITABLE, what="installing metaros", env=EDITABLE_ENV)


def install(*, state: str) -> None:
    """Install the lock and this project, unless the stamp says that is done."""
    if STAMP.exists() and STAMP.read_text() == state:
        return
    say("installing locked dependencies (a minute on a fresh machine)")
    if not install_by_uv():
        install_by_pip()
    STAMP.write_text(state)


@contextmanager
def compiling() -> Iterator[None]:
    """Compile our modules and tests meanwhile, by collecting the tests: the first run is as fast as the next.

    Only where there is no bytecode yet; what goes wrong is said by the tests themselves.
    """
    fresh = not any((ROOT / "tests").glob("__pycache__/*.pyc"))
    env = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    collect = [str(PYTHON), "-m", "pytest", "--collect-only", "-qq", "-p", "no:cacheprovider"]
    halves = (["tests/gateway"], ["tests", "--ignore=tests/gateway"]) if fresh else ()
    running = [
        subprocess.Popen([*collect, *half], cwd=ROOT, env=env, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        for half in halves
    ]
    try:
        yield
    finally:
        for process in running:
            process.wait()


def build_dashboard() -> None:
    """Build the dashboard if its sources changed; a machine that cannot is told, and goes on without."""
    done = subprocess.run([str(PYTHON), "tools/dashboard.py", "build"], cwd=ROOT)
    if done.returncode:
        say("the dashboard could not be built (see above); everything else works")


def main() -> None:
    """Everything, in order."""
    if sys.version_info < (3, 11):  # noqa: UP036 - an older Python may well run this file
        raise SystemExit("metaros: needs Python 3.11 or newer (Debian: apt install python3)")
    STATE.mkdir(exist_ok=True)
    make_venv()
    install(state=fingerprint([ROOT / "requirements.lock", ROOT / "pyproject.toml"]))
    with compiling():
        build_dashboard()
    for commands, what, package in OPTIONAL:
        if not any(map(shutil.which, commands)):
            say(f"no {commands[0]}: {what} are skipped (Debian: apt install {package})")


if __name__ == "__main__":
    main()
