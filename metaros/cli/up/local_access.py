"""Credentials of this machine's user for the gateway that `metaros up` has started: a sign-in link and an API key.

The gateway writes a key into its data directory, which only this user reads. With it one asks for a link that signs a
browser in once; and the command line finds it through `~/.metaros/credentials`.
"""

from __future__ import annotations

import contextlib
import http.client
import json
from pathlib import Path
from typing import TYPE_CHECKING

from metaros.access.credentials import forget_key, save_key
from metaros.access.trust import open_connection
from metaros.cli.shared.instances import gateway_folder
from metaros.errors import ConfigError

if TYPE_CHECKING:
    from metaros.cli.up.launch_table import Plan

__all__ = ["grant_access", "local_key", "make_secret", "revoke_access", "sign_in_link"]

TIMEOUT_S = 5.0


def local_key(plan: Plan) -> str:
    """The running gateway's key for this user; "" while there is none."""
    try:
        return _file(plan).read_text().strip()
    except OSError:
        return ""


def grant_access(plan: Plan) -> str:
    """Let the command line find the key; what went wrong with that, or ""."""
    try:
        for url, file in _files(plan):
            save_key(url, file, ca=plan.root_file)
    except ConfigError as error:
        return str(error)
    return ""


def revoke_access(plan: Plan) -> None:
    """The gateway is gone: whoever has its port next is not to be shown a key."""
    for url, file in _files(plan):
        with contextlib.suppress(ConfigError):
            forget_key(url, file)


def sign_in_link(plan: Plan) -> str:
    """A link that signs a browser in once; "" where the gateway gives none. Blocks: call it in a thread."""
    token = make_secret(plan.url, "/api/v1/auth/links", "token", key=local_key(plan), ca=plan.root_file)
    return f"{plan.url}/signin#{token}" if token else ""


def make_secret(url: str, path: str, name: str, *, key: str, ca: Path | None = None) -> str:
    """What a gateway makes at `path` without being told more, as its answer has it under `name`; "" where it does not.

    Blocks: call it in a thread.
    """
    headers = {"Content-Type": "application/json", "Authorization": f"Bearer {key}"}
    try:
        connection = open_connection(url, timeout_s=TIMEOUT_S, ca=ca)
    except ConfigError:
        return ""
    try:
        connection.request("POST", path, body=b"{}", headers=headers)
        response = connection.getresponse()
        document = json.loads(response.read() or b"null")
        return str(document[name]) if response.status == 201 else ""
    except (OSError, ValueError, TypeError, KeyError, http.client.HTTPException):
        return ""
    finally:
        connection.close()


def _files(plan: Plan) -> list[tuple[str, Path]]:
    """Each gateway's URL, and the file with its key."""
    folders = [replica.name.replace(" ", "-") for replica in plan.replicas]
    further = [plan.data_dir.resolve() / folder / "local.key" for folder in folders]
    return [(plan.url, _file(plan)), *zip(plan.replica_urls, further, strict=True)]


def _file(plan: Plan) -> Path:
    return gateway_folder(plan.data_dir.resolve()) / "local.key"
