"""The keys of this user: `$METAROS_KEY`, or `~/.metaros/credentials`, which `metaros up` writes for its own gateway.

The file holds a key a gateway, or the path of a file with it, as a local gateway has another key after each start; so
no key is ever shown to another gateway. Beside it is the path of the root certificate that vouches for a gateway on
this machine. Only its owner can read the file.
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

from metaros.concurrency.file_lock import file_lock
from metaros.errors import ConfigError

__all__ = ["ca_for", "credentials_file", "forget_key", "key_for", "local_gateway", "save_key"]

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


def ca_for(url: str) -> Path | None:
    """The file of the root certificates that alone vouch for the gateway at `url`; None: this system's do.

    Raises:
        ConfigError: others can write the file, or it cannot be read.
    """
    if named := os.environ.get("METAROS_CA", "").strip():
        return Path(named)
    found = _read("roots").get(_origin(url), "")
    return Path(found) if found else None


def local_gateway(data_dir: Path | None = None) -> str:
    """Where the gateway of that data directory serves, or the one that started last; "" where there is none."""
    for url, key in reversed(_read().items()):
        path = Path(key)
        if not key.startswith(KEY) and path.is_file() and (data_dir is None or path.parent == data_dir.resolve()):
            return url
    return ""


def save_key(url: str, key: str | Path, *, ca: Path | None = None) -> None:
    """Remember the key of the gateway at `url`, or in which file it is, and where the root above its certificate is."""
    with _changing():
        keys, roots = _read(), _read("roots")
        keys.pop(_origin(url), None)
        roots.pop(_origin(url), None)
        kept = dict([*_newest(keys), (_origin(url), str(key))])
        if ca is not None:
            roots[_origin(url)] = str(ca)
        _write(kept, {where: path for where, path in roots.items() if where in kept})


def forget_key(url: str, key: str | Path) -> None:
    """Forget it, unless another one is there by now."""
    with _changing():
        keys, roots = _read(), _read("roots")
        if keys.get(_origin(url)) == str(key):
            del keys[_origin(url)]
            roots.pop(_origin(url), None)
            _write(keys, roots)


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


def _newest(keys: dict[str, str]) -> list[tuple[str, str]]:
    """As many as there is room for; what was left by gateways that were killed goes first."""
    if len(keys) < ENTRIES:
        return list(keys.items())
    good = [(url, key) for url, key in keys.items() if key.startswith(KEY) or Path(key).is_file()]
    return good[1 - ENTRIES :]


def _read(table: str = "gateways") -> dict[str, str]:
    """Keys, or paths of keys, by gateway; or `roots`, the paths of root certificates."""
    path = credentials_file()
    try:
        if not path.exists():
            return {}
        if os.name == "posix" and path.stat().st_mode & 0o077:
            raise ConfigError(f"others can read your keys in {path}\nMake the file yours alone: chmod 600 {path}")
        document: Any = json.loads(path.read_text())
        found = document["gateways"] if table == "gateways" else document.get(table, {})
        return {str(url): str(key) for url, key in found.items()}
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror or error}") from error
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ConfigError(f"{path} is damaged\nDelete it; `metaros up` writes it again.") from error


def _write(keys: dict[str, str], roots: dict[str, str]) -> None:
    """In one step, and never readable by others, not even for a moment."""
    path = credentials_file()
    draft = path.with_name(f"{path.name}.{secrets.token_hex(4)}")
    try:
        descriptor = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(descriptor, "w") as file:
            json.dump({"gateways": keys, **({"roots": roots} if roots else {})}, file, indent=2)
            file.write("\n")
        draft.replace(path)
    except OSError as error:
        draft.unlink(missing_ok=True)
        raise ConfigError(f"cannot write {path}: {error.strerror or error}") from error
