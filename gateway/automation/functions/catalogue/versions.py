"""Versions: numbered copies of a function that never change."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from gateway.automation.functions.catalogue.lookup import check_revision, named, place
from gateway.automation.functions.catalogue.names import parse_function
from gateway.automation.functions.catalogue.pages import page
from gateway.automation.functions.catalogue.records import VERSION, Draft, Records
from gateway.automation.functions.catalogue.settings import configuration, new_revision, shown_sha256
from gateway.automation.functions.errors import FunctionChangedError, FunctionInvalidError, NotImplementedHereError
from gateway.store.automation.functions import Record
from metaros.limits import LIMITS

__all__ = ["list_versions_by_function", "publish", "publish_version"]


def publish_version(draft: Draft, asked: Mapping[str, Any]) -> dict[str, Any]:
    """A version of what is being worked on."""
    if asked.get("PublishTo"):
        raise NotImplementedHereError("PublishTo is not implemented by Meta-ROS")
    latest = named(draft, parse_function(asked["FunctionName"]).name)
    check_revision(latest, asked)
    sha256, description = asked.get("CodeSha256") or "", asked.get("Description")
    record = publish(draft, latest, description=description, sha256=sha256)
    return configuration(record, draft, qualifier=record.id)


def list_versions_by_function(records: Records, asked: Mapping[str, Any]) -> dict[str, Any]:
    """What is being worked on, then the versions by number."""
    latest = named(records, parse_function(asked["FunctionName"]).name)
    found = sorted([latest, *records.all(VERSION, latest.owner)], key=place)

    def shown(item: Record) -> dict[str, Any]:
        return configuration(item, records, qualifier=item.id)

    return page(found, asked, "Versions", shown, key=place)


def publish(draft: Draft, latest: Record, *, description: str | None = None, sha256: str = "") -> Record:
    """A version with the function's settings and code; the last one again where nothing has changed since.

    Raises:
        FunctionChangedError: the code is not the one with `sha256` (as the API shows it).
        FunctionInvalidError: there are as many versions as may be.
    """
    if sha256 and sha256 != shown_sha256(latest.document["code"]):
        raise FunctionChangedError("CodeSha256 is not that of the function's code: somebody else was faster")
    versions = draft.all(VERSION, latest.owner)
    newest = max(versions, key=lambda item: int(item.id), default=None)
    if newest is not None and newest.document["build"] == latest.document["build"]:
        return newest
    if len(versions) >= LIMITS.function_versions:
        raise FunctionInvalidError(
            f"{latest.owner} has {LIMITS.function_versions} versions, which is the bound: delete some"
        )
    number, settings = latest.document["next"], dict(latest.document["settings"])
    if description is not None:
        settings["Description"] = description
    draft.put(replace(latest, document={**latest.document, "next": number + 1}))
    copied = {key: latest.document[key] for key in ("code", "code_bytes", "unpacked_bytes", "build")}
    document = {**copied, "settings": settings, "revision": new_revision(), "modified_ns": draft.now_ns}
    return draft.put(Record(VERSION, latest.owner, str(number), document))
