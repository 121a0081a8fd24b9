"""Versions as people sign and publish them, for tests: a folder with keys, and what goes to a gateway."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gateway.fleet.updates import offline
from metaros.clock import SystemClock
from tests.gateway.fleet.updates.repositories import passphrase
from tests.support.deployment.bundles import make_bundle

__all__ = ["Release", "signed_release", "start_signing"]

WHEEL = "wheels/metaros-0-py3-none-any.whl"


class Release:
    """A bundle's bytes, and the document that makes it known."""

    def __init__(self, content: bytes, document: dict[str, Any]) -> None:
        self.content, self.document = content, document


def start_signing(folder: Path, online_keys: dict[str, Any]) -> None:
    """The people's folder, with a root that names the gateway's keys."""
    offline.init_root(folder, online_keys, passphrase, now_ns=SystemClock().wall_ns())


def signed_release(
    folder: Path, version: str, members: Mapping[str, bytes] | None = None, *, node: str = ""
) -> Release:
    """A version of the agent, or of a node's bundle, signed; `members` lie in it beside the wheel."""
    made = {WHEEL: version.encode(), **(members or {})}
    name, kind = (node, "node") if node else ("metaros", "agent")
    bundle = make_bundle(folder / "made", name=name, kind=kind, version=version, members=made)
    path = offline.add(folder, bundle)
    offline.sign_role(folder, "targets", passphrase, now_ns=SystemClock().wall_ns())
    found = offline.release(folder)
    document = {"roots": [text.decode() for text in found.roots], "targets": found.targets.decode()}
    return Release((folder / "bundles" / path).read_bytes(), document)
