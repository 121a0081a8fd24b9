"""The keys of this user: `$METAROS_KEY`, or `~/.metaros/credentials`, which `metaros up` writes for its own gateway.

The file holds a key a gateway, or the path of a file with it, as a local gateway has another key after each start; so
no key is ever shown to another gateway. Only its owner can read it.
"""

from __future__ import annotations

import json
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from metaros.cli.instance import file_lock
from metaros.errors import ConfigError

__all__ = ["credentials_file", "forget_key", "key_for", "save_key"]

KEY = "mrk_"
ENTRIES = 64  # the newest; the file never grows beyond
LOOPBACK = ("localhost", "127.0.0.1", "::1")


def credentials_file() -> Path:
    """Where the keys are."""
    return Path.home() / ".metaros" / "credentials"


def key_for(url: str) -> str:
    """The key for the gateway at `url`; "" where there is none.

    Raises:
        ConfigError: others can read the file, or it cannot be read.
    """
    if key := os.environ.get("METAROS_KEY", "").strip():
        return key
    kept = _read().get(_origin(url), "")
    return kept if not kept or kept.startswith(KEY) else _read_key(Path(kept))


def save_key(url: str, key: str | Path) -> None:
    """Remember the key of the gateway at `url`, or in which file it is."""
    with _changing():
        kept = _read()
        kept.pop(_origin(url), None)
        _write(dict([*kept.items(), (_origin(url), str(key))][-ENTRIES:]))


def forget_key(url: str, key: str | Path) -> None:
    """Forget it, unless another one is there by now."""
    with _changing():
        kept = _read()
        if kept.get(_origin(url)) == str(key):
            del kept[_origin(url)]
            _write(kept)


@contextmanager
def _changing() -> Iterator[None]:
    """Two programs that change the file at once do it one after the other."""
    path = credentials_file()
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        with file_lock(path.with_name("credentials.lock")):
            yield
    except OSError as error:
        raise ConfigError(f"cannot write {path}: {error.strerror or error}") from error


def _read_key(path: Path) -> str:
    """What the file holds, if that is a key; "" while its gateway does not run."""
    try:
        key = path.read_text().strip()
    except (OSError, UnicodeDecodeError):
        return ""
    return key if key.startswith(KEY) and key.isprintable() else ""


def _origin(url: str) -> str:
    """Scheme, host and port, alike however the address is written."""
    parts = urlsplit(url if "://" in url else f"http://{url}")
    host = (parts.hostname or "").lower()
    host = "127.0.0.1" if host in LOOPBACK else host
    port = parts.port or (443 if parts.scheme == "https" else 80)
    return f"{parts.scheme}://{f'[{host}]' if ':' in host else host}:{port}"


def _read() -> dict[str, str]:
    path = credentials_file()
    try:
        if not path.exists():
            return {}
        if os.name == "posix" and path.stat().st_mode & 0o077:
            raise ConfigError(f"others can read your keys in {path}\nMake the file yours alone: chmod 600 {path}")
        document: Any = json.loads(path.read_text())
        return {str(url): str(key) for url, key in document["gateways"].items()}
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror or error}") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ConfigError(f"{path} is damaged\nDelete it; `metaros up` writes it again.") from error


def _write(keys: dict[str, str]) -> None:
    """In one step, and never readable by others, not even for a moment."""
    path = credentials_file()
    draft = path.with_name(f"{path.name}.{secrets.token_hex(4)}")
    try:
        descriptor = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(descriptor, "w") as file:
            json.dump({"gateways": keys}, file, indent=2)
            file.write("\n")
        draft.replace(path)
    except OSError as error:
        draft.unlink(missing_ok=True)
        raise ConfigError(f"cannot write {path}: {error.strerror or error}") from error
