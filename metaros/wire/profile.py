"""The protected profile: one router, client sessions with user and password, and who may drive what moves.

The router knows three users. `agent` and `drive` may do everything; `node` may do everything but publish on actuator
topics, or answer in the place of who does. A folder holds the router's configuration and one session file a user, in
Zenoh's own format: `ZENOH_SESSION_CONFIG_URI` names it, for our nodes and for those of ROS 2 alike.

A rule of Zenoh's speaks of a message whose key lies within its own keys. So a rule that denies `*/**/cmd_vel/*/*` lets
a put on `0/**` pass, which reaches `cmd_vel` all the same. What `node` may publish on is therefore told by what is
allowed: names that differ from each actuator's at some letter. A key with a wildcard in the name's place is in none.

Zenoh drops what a user may not send without a word to the sender. Access control is the router's, so sessions must be
clients: two peers that are linked to each other would pass it by.
"""

from __future__ import annotations

import json
import os
import re
import secrets
import stat
import string
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, Literal

from metaros.errors import ConfigError
from metaros.wire.names import NO_HASH

__all__ = [
    "ACTUATORS",
    "USERS",
    "ZenohUser",
    "actuator_keys",
    "default_folder",
    "make_profile",
    "other_keys",
    "session_file",
]

ZenohUser = Literal["agent", "drive", "node"]

USERS: Final[tuple[ZenohUser, ...]] = ("agent", "drive", "node")
ACTUATORS: Final = ("**/cmd_vel",)
CONNECT_MS = 3000
_PASSWORD_BYTES = 16
_PASSWORD = re.compile(r"[0-9a-f]{32}")

_SPEAKING: Final = ("put", "delete", "reply", "declare_queryable")
_LISTENING: Final = (
    *("declare_subscriber", "query"),
    *("liveliness_token", "declare_liveliness_subscriber", "liveliness_query"),
)
# ** matches no chunk that begins with @
_EVERYTHING: Final = ("**", "@ros2_lv/**", "@metaros/**", "**/@adv/**", "**/@metaros/**")
_NO_DATA: Final = ("*", "*/*", "*/*/*", "@ros2_lv/**", "@metaros/**")  # a data key has four chunks at least
_BESIDE: Final = ("/@adv/**", "/@metaros/**", "/_buf_cpu", "/_buf/**")  # what is beside the data itself
_HASHES: Final = ("RIHS01_$*", NO_HASH)
_LETTERS: Final = string.ascii_letters + string.digits + "_"  # of ROS names
_SESSION: Final[Mapping[str, object]] = {
    "mode": "client",
    "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
    "timestamping": {"enabled": True},
    "queries_default_timeout": 600_000,
}


def default_folder() -> Path:
    """Where the profile is when nobody says."""
    return Path.home() / ".metaros" / "zenoh"


def session_file(folder: Path, user: ZenohUser) -> Path:
    """The file for a user's sessions. Raises ConfigError where no router has made it."""
    path = folder / f"{user}.json5"
    if not path.is_file():
        raise ConfigError(f"no {path}: the router makes it: metaros router --zenoh-profile protected")
    return path


def actuator_keys(actuators: Sequence[str]) -> list[str]:
    """Zenoh's key expressions of topic patterns, in all domains, with all that is beside the data itself."""
    keys = []
    for pattern in actuators:
        chunks = [part if part == "**" else part.replace("*", "$*") for part in pattern.strip("/").split("/")]
        key = "/".join(("*", *("*" if part == "$*" else part for part in chunks), "*", "*"))
        keys += [key, *(key + beside for beside in _BESIDE)]
    return keys


def other_keys(actuators: Sequence[str]) -> list[str]:
    """Key expressions of every topic whose last name is no actuator's; none has a key in common with an actuator's.

    Raises ConfigError for a pattern whose last name has a wildcard: it cannot be told what differs from it.
    """
    names = {pattern.rstrip("/").rpartition("/")[2] for pattern in actuators}
    if bad := [name for name in names if not name or set(name) - set(_LETTERS)]:
        raise ConfigError(f"the last name of an actuator pattern is letters, digits and _, not {bad[0]!r}")
    begun = {name[:length] for name in names for length in range(len(name) + 1)}
    free = [start + letter for start in begun for letter in _LETTERS if start + letter not in begun]
    others = [f"{start}$*" for start in free] + [start for start in begun - names if start]
    data = [f"*/**/{name}/*/{type_hash}" for name in sorted(others) for type_hash in _HASHES]
    return [*data, *(key + beside for key in data for beside in _BESIDE)]


def make_profile(folder: Path, endpoint: str, *, actuators: Sequence[str] = ACTUATORS) -> Path:
    """Write all files of the profile; passwords that are there stay. Returns the router's configuration.

    `endpoint` is the router's, like tcp/127.0.0.1:7447. Raises ConfigError: the folder cannot be written, or others
    can read it.
    """
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if sys.platform != "win32" and stat.S_IMODE(folder.stat().st_mode) & 0o077:
            raise ConfigError(f"{folder} holds passwords, and others can read it: chmod 700 {folder}")
        passwords = _passwords(folder / "users")
        _write(folder / "users", "".join(f"{user}:{passwords[user]}\n" for user in USERS))
        for user in USERS:
            _write(folder / f"{user}.json5", json.dumps(_session(endpoint, user, passwords[user]), indent=1))
        router = folder / "router.json5"
        _write(router, json.dumps(_router(endpoint, folder / "users", actuators), indent=1))
    except OSError as error:
        raise ConfigError(f"cannot write {folder}: {error.strerror}") from error
    return router


def _session(endpoint: str, user: str, password: str) -> dict[str, Any]:
    return {
        **_SESSION,
        "connect": {"endpoints": [endpoint], "timeout_ms": CONNECT_MS, "exit_on_failure": True},
        "transport": {
            "auth": {"usrpwd": {"user": user, "password": password}},
            "link": {"tx": {"lease": 3000}},
            "shared_memory": {"enabled": False},
        },
    }


def _router(endpoint: str, users: Path, actuators: Sequence[str]) -> dict[str, Any]:
    return {
        "mode": "router",
        "listen": {"endpoints": [endpoint]},
        "scouting": {"multicast": {"enabled": False}, "delay": 0},
        "timestamping": {"enabled": True},
        "queries_default_timeout": 600_000,
        "transport": {"link": {"tx": {"lease": 3000}}, "auth": {"usrpwd": {"dictionary_file": str(users)}}},
        "access_control": {
            "enabled": True,
            "default_permission": "deny",
            "rules": [
                _allowed("all", ["ingress", "egress"], [*_SPEAKING, *_LISTENING], _EVERYTHING),
                _allowed("listen", ["ingress"], _LISTENING, _EVERYTHING),
                _allowed("speak", ["ingress"], _SPEAKING, [*_NO_DATA, *other_keys(actuators)]),
                _allowed("hear", ["egress"], [*_SPEAKING, *_LISTENING], _EVERYTHING),
                {**_allowed("actuators", ["ingress"], _SPEAKING, actuator_keys(actuators)), "permission": "deny"},
            ],
            "subjects": [{"id": "drivers", "usernames": ["agent", "drive"]}, {"id": "node", "usernames": ["node"]}],
            "policies": [
                {"rules": ["all"], "subjects": ["drivers"]},
                {"rules": ["listen", "speak", "hear", "actuators"], "subjects": ["node"]},
            ],
        },
    }


def _allowed(name: str, flows: Sequence[str], messages: Sequence[str], keys: Sequence[str]) -> dict[str, Any]:
    return {"id": name, "permission": "allow", "flows": flows, "messages": messages, "key_exprs": keys}


def _passwords(path: Path) -> dict[str, str]:
    """Those of an earlier start, and new ones for who has none."""
    kept = {}
    if path.is_file():
        for line in path.read_text().splitlines():
            user, _, password = line.partition(":")
            if _PASSWORD.fullmatch(password):
                kept[user] = password
    return {user: kept.get(user) or secrets.token_hex(_PASSWORD_BYTES) for user in USERS}


def _write(path: Path, text: str) -> None:
    """Replace a file; nobody else can read it at any moment."""
    draft = path.with_name(f".{path.name}.{os.getpid()}")
    draft.unlink(missing_ok=True)
    descriptor = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "w") as file:
        file.write(text)
    draft.replace(path)
