"""The file of `--notify`: TOML with one table for each webhook and each mail server."""

from __future__ import annotations

import re
import ssl
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from gateway.alerting.alerts.notices.route import Mailbox, Route
from gateway.domain.finding import SEVERITIES
from gateway.outbound.webhook import Webhook, signing_key
from gateway.store.private_dir import others_can_read
from metaros.errors import ConfigError
from metaros.limits import LIMITS, Limits

__all__ = ["SMTP_KEYS", "WEBHOOK_KEYS", "load_routes"]

FILE_BYTES = 256 * 1024
SECRET_BYTES = 4096
_NAME = re.compile(r"[a-z0-9][a-z0-9_.-]{0,62}")
_ADDRESS = re.compile(r"[^\s@<>,;:\"()\[\]\x00-\x20\x7f]+@[A-Za-z0-9.-]+")
_HOST = re.compile(r"[A-Za-z0-9.:-]{1,253}")
_PORTS = {"starttls": 587, "tls": 465, "off": 25}


@dataclass(frozen=True, slots=True)
class Key:
    """What a key of a table is: its type, and what more must hold."""

    kind: type | tuple[type, ...]
    fits: Callable[[Any], bool] = lambda value: True
    words: str = ""


def _seconds(value: float) -> bool:
    return 0 <= value <= 30 * 86_400


def _globs(value: Any) -> bool:
    return len(value) <= 64 and all(isinstance(item, str) and 0 < len(item) <= 128 for item in value)


_TEXT = Key(str, lambda value: value.isprintable() and len(value) <= 2000, "a text without line breaks")
_COMMON: dict[str, Key] = {
    "name": Key(str, lambda value: _NAME.fullmatch(value) is not None, "1 to 63 of a-z, 0-9, '_', '.', '-'"),
    "severity": Key(str, lambda value: value in SEVERITIES, f"one of {', '.join(SEVERITIES)}"),
    "robots": Key(list, _globs, "a list of patterns"),
    "causes": Key(list, _globs, "a list of patterns"),
    "private": Key(bool),
    "ca_file": _TEXT,
    "wait_s": Key((int, float), _seconds, "0 to 30 days"),
    "again_s": Key((int, float), _seconds, "0 to 30 days"),
    "repeat_s": Key((int, float), lambda value: value >= 60 and _seconds(value), "60 s to 30 days"),
    "link": Key(str, lambda value: value.isprintable() and value.startswith(("http://", "https://")), "an http(s) URL"),
}
WEBHOOK_KEYS = {**_COMMON, "url": _TEXT, "secret_file": _TEXT, "token_file": _TEXT}
SMTP_KEYS = {
    **_COMMON,
    "host": Key(str, lambda value: _HOST.fullmatch(value) is not None, "a name or an address"),
    "port": Key(int, lambda value: 0 < value < 65_536, "1 to 65535"),
    "tls": Key(str, lambda value: value in _PORTS, f"one of {', '.join(_PORTS)}"),
    "user": _TEXT,
    "password_file": _TEXT,
    "from": Key(str, lambda value: _ADDRESS.fullmatch(value) is not None, "an address like robots@example.org"),
    "to": Key(
        list,
        lambda value: 0 < len(value) <= 32 and all(isinstance(x, str) and _ADDRESS.fullmatch(x) for x in value),
        "1 to 32 addresses like ann@example.org",
    ),
}
_SHARED = ("wait_s", "again_s", "repeat_s", "link")


def load_routes(path: Path, *, limits: Limits = LIMITS) -> tuple[Route, ...]:
    """Read the file, and the files of secrets that it names: relative ones lie beside it.

    Raises:
        ConfigError: a file cannot be read, others can read a secret, or a key is unknown, missing or does not fit; it
            names the table and the key.
    """
    try:
        document = tomllib.loads(_read(path, FILE_BYTES).decode())
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError(f"--notify {path}: not TOML: {error}") from error
    shared = {key: document.pop(key) for key in _SHARED if key in document}
    _check(path, "the top", shared, _COMMON, ())
    tables = [("webhook", item) for item in _list(path, document, "webhook")]
    tables += [("smtp", item) for item in _list(path, document, "smtp")]
    if document:
        raise ConfigError(f"--notify {path}: {min(document)} is no key of it: there are [[webhook]] and [[smtp]]")
    if len(tables) > limits.notice_routes:
        raise ConfigError(f"--notify {path}: {len(tables)} routes, at most {limits.notice_routes} may be")
    routes = tuple(_route(path, kind, number, {**shared, **item}) for number, (kind, item) in enumerate(tables, 1))
    names = [route.name for route in routes]
    for name in names:
        if names.count(name) > 1:
            raise ConfigError(f"--notify {path}: two routes are called {name}")
    return routes


def _list(path: Path, document: dict[str, Any], kind: str) -> list[dict[str, Any]]:
    found = document.pop(kind, [])
    if not isinstance(found, list) or not all(isinstance(item, dict) for item in found):
        raise ConfigError(f"--notify {path}: {kind} is written [[{kind}]]")
    return found


def _check(path: Path, place: str, table: Mapping[str, Any], keys: Mapping[str, Key], needed: tuple[str, ...]) -> None:
    for name in needed:
        if name not in table:
            raise ConfigError(f"--notify {path}: {place} lacks {name}")
    for name, value in table.items():
        key = keys.get(name)
        if key is None:
            raise ConfigError(f"--notify {path}: {name} is no key of {place}: there are {', '.join(keys)}")
        right = isinstance(value, key.kind) and (key.kind is bool or not isinstance(value, bool))
        if not right or not key.fits(value):
            raise ConfigError(f"--notify {path}: {name} of {place} is {key.words or 'true or false'}")


def _route(path: Path, kind: str, number: int, table: dict[str, Any]) -> Route:
    place = f"{kind} {table.get('name', number)}"
    if kind == "webhook":
        _check(path, place, table, WEBHOOK_KEYS, ("name", "url"))
        to: Webhook | Mailbox = _webhook(path, place, table)
    else:
        _check(path, place, table, SMTP_KEYS, ("name", "host", "from", "to"))
        to = _mailbox(path, place, table)
    lists: dict[str, Any] = {key: tuple(table[key]) for key in ("robots", "causes") if key in table}
    plain = {key: table[key] for key in ("name", "severity", *_SHARED) if key in table}
    return Route(to=to, **lists, **plain)


def _webhook(path: Path, place: str, table: Mapping[str, Any]) -> Webhook:
    private = table.get("private", False)
    try:
        parts = urlsplit(table["url"])
        good = parts.scheme in ("http", "https") and parts.hostname and parts.port != 0 and parts.username is None
    except ValueError:
        good = False
    if not good or not table["url"].isascii() or " " in table["url"]:
        raise ConfigError(f"--notify {path}: url of {place} is no http(s) URL, or has a user in it")
    if parts.scheme == "http" and not private:
        raise ConfigError(
            f"--notify {path}: url of {place} is http: plain only within a private network, private = true"
        )
    token = _secret(path, table, "token_file").decode("ascii", "replace")
    if not token.isprintable() or "\ufffd" in token:
        raise ConfigError(f"--notify {path}: token_file of {place} holds what no header may")
    return Webhook(
        url=table["url"],
        secret=_signing(path, place, _secret(path, table, "secret_file")),
        token=token,
        private=private,
        context=_context(path, table),
    )


def _mailbox(path: Path, place: str, table: Mapping[str, Any]) -> Mailbox:
    tls = table.get("tls", "starttls")
    user, password = table.get("user", ""), _secret(path, table, "password_file").decode(errors="replace")
    if bool(user) != bool(password):
        raise ConfigError(f"--notify {path}: user and password_file of {place} go together")
    if tls == "off" and (user or not table.get("private", False)):
        raise ConfigError(
            f"--notify {path}: tls of {place} is off: only within a private network, private = true, without a user"
        )
    return Mailbox(
        host=table["host"],
        port=table.get("port", _PORTS[tls]),
        tls=tls,
        sender=table["from"],
        to=tuple(table["to"]),
        user=user,
        password=password,
        private=table.get("private", False),
        context=_context(path, table),
    )


def _signing(path: Path, place: str, secret: bytes) -> bytes:
    """The key that signs: a secret that begins with whsec_ is base64, as Standard Webhooks has it."""
    try:
        return signing_key(secret.decode("latin-1")) if secret.startswith(b"whsec_") else secret
    except ValueError as error:
        raise ConfigError(f"--notify {path}: secret_file of {place} is no base64 behind whsec_") from error


def _secret(path: Path, table: Mapping[str, Any], key: str) -> bytes:
    if key not in table:
        return b""
    file = path.parent / table[key]
    found = _read(file, SECRET_BYTES, alone=True).strip()
    if not found:
        raise ConfigError(f"--notify {path}: {file} is empty")
    return found


def _context(path: Path, table: Mapping[str, Any]) -> ssl.SSLContext:
    """Made once: reading the system's roots takes long enough to be felt on the event loop."""
    if "ca_file" not in table:
        return ssl.create_default_context()
    file = path.parent / table["ca_file"]
    try:
        return ssl.create_default_context(cadata=_read(file, FILE_BYTES).decode("ascii"))
    except (ssl.SSLError, UnicodeDecodeError) as error:
        raise ConfigError(f"--notify {path}: {file} is no PEM of certificates") from error


def _read(file: Path, most: int, *, alone: bool = False) -> bytes:
    try:
        if alone and others_can_read(file):
            raise ConfigError(f"others can read {file}, which holds a secret\nchmod 600 {file}")
        with file.open("rb") as opened:
            found = opened.read(most + 1)
    except OSError as error:
        raise ConfigError(f"--notify: {file}: {error.strerror or error}") from error
    if len(found) > most:
        raise ConfigError(f"--notify: {file} is over {most} bytes")
    return found
