"""Functions: made, shown, changed and deleted, each by what AWS's operation of that name asks and answers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from gateway.automation.functions.catalogue.aliases import shares
from gateway.automation.functions.catalogue.code import CodeFacts
from gateway.automation.functions.catalogue.lookup import check_revision, named, place, unknown, version_of
from gateway.automation.functions.catalogue.names import LATEST, parse_function
from gateway.automation.functions.catalogue.pages import page
from gateway.automation.functions.catalogue.records import (
    ALIAS,
    ASYNC,
    FUNCTION,
    MAPPING,
    POLICY,
    PROVISIONED,
    VERSION,
    Draft,
    Records,
)
from gateway.automation.functions.catalogue.settings import check_unpacked, configuration, new_revision, take_settings
from gateway.automation.functions.catalogue.versions import publish
from gateway.automation.functions.errors import (
    FunctionConflictError,
    FunctionInvalidError,
    NotImplementedHereError,
)
from gateway.store.automation.functions import Record
from metaros.limits import LIMITS

__all__ = [
    "create_function",
    "delete_function",
    "get_function",
    "get_function_configuration",
    "list_functions",
    "update_function_code",
    "update_function_configuration",
]


def create_function(draft: Draft, asked: Mapping[str, Any]) -> dict[str, Any]:
    """A new function; with Publish its first version, too."""
    name, qualifier = parse_function(asked["FunctionName"])
    if qualifier:
        raise FunctionInvalidError("FunctionName: a new function's name has no qualifier")
    if draft.get(FUNCTION, name, LATEST) is not None:
        raise FunctionConflictError(f"Function already exist: {name}")
    if len(draft.all(FUNCTION)) >= LIMITS.functions:
        raise FunctionInvalidError(f"There are {LIMITS.functions} functions already, which is the bound: delete one")
    code: CodeFacts = asked["Code"]
    document = {
        "settings": take_settings(asked, draft),
        **code.document,
        "build": new_revision(),
        "revision": new_revision(),
        "modified_ns": draft.now_ns,
        "next": 1,
        "reserved": None,
        "tags": dict(asked.get("Tags") or {}),
    }
    check_unpacked(document, draft)
    record = draft.put(Record(FUNCTION, name, LATEST, document))
    if asked.get("Publish"):
        record = publish(draft, record)
        return configuration(record, draft, qualifier=record.id)
    return configuration(record, draft)


def get_function(records: Records, asked: Mapping[str, Any]) -> dict[str, Any]:
    """A version with where its code can be fetched; the place itself is filled in by who knows its address."""
    record, qualifier = version_of(records, asked["FunctionName"], asked.get("Qualifier") or "")
    answer: dict[str, Any] = {
        "Configuration": configuration(record, records, qualifier=qualifier),
        "Code": {"RepositoryType": "S3", "Location": record.code},
    }
    latest = named(records, record.owner)
    if latest.document["tags"]:
        answer["Tags"] = dict(latest.document["tags"])
    if latest.document["reserved"] is not None:
        answer["Concurrency"] = {"ReservedConcurrentExecutions": latest.document["reserved"]}
    return answer


def get_function_configuration(records: Records, asked: Mapping[str, Any]) -> dict[str, Any]:
    """A version's settings."""
    record, qualifier = version_of(records, asked["FunctionName"], asked.get("Qualifier") or "")
    return configuration(record, records, qualifier=qualifier)


def list_functions(records: Records, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Every function by name; with FunctionVersion ALL its versions, too."""
    if asked.get("MasterRegion") not in (None, "ALL"):
        raise NotImplementedHereError("MasterRegion is not implemented by Meta-ROS: there are no edge replicas")
    every = asked.get("FunctionVersion") == "ALL"
    found = sorted(records.all(FUNCTION) + (records.all(VERSION) if every else []), key=place)

    def shown(item: Record) -> dict[str, Any]:
        return configuration(item, records, qualifier=item.id if every else "")

    return page(found, asked, "Functions", shown, key=place)


def update_function_configuration(draft: Draft, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Other settings for what is being worked on."""
    record = _latest(draft, asked)
    settings = take_settings(asked, draft, record.document["settings"])
    return configuration(_changed(draft, record, settings=settings), draft)


def update_function_code(draft: Draft, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Other code for what is being worked on; with DryRun only what would become of it."""
    record = _latest(draft, asked)
    take_settings(
        {name: asked[name] for name in ("Architectures", "PublishTo") if name in asked},
        draft,
        record.document["settings"],
    )
    code: CodeFacts = asked["Code"]
    if asked.get("DryRun"):
        return configuration(replace(record, document={**record.document, **code.document}), draft)
    record = _changed(draft, record, **code.document)
    if asked.get("Publish"):
        record = publish(draft, record)
        return configuration(record, draft, qualifier=record.id)
    return configuration(record, draft)


def delete_function(draft: Draft, asked: Mapping[str, Any]) -> dict[str, Any]:
    """A version that no alias needs; without a qualifier the function, with all that belongs to it."""
    name, qualifier = parse_function(asked["FunctionName"], asked.get("Qualifier") or "")
    record = named(draft, name)
    if not qualifier:
        draft.remove(record)
        for kind in (VERSION, ALIAS, ASYNC, PROVISIONED, POLICY, MAPPING):
            for item in draft.all(kind, name):
                draft.remove(item)
        return {}
    if not qualifier.isdigit():
        raise FunctionInvalidError(
            f"Qualifier {qualifier!r}: a version's number is deleted here; aliases by DeleteAlias"
        )
    version = draft.get(VERSION, name, qualifier)
    if version is None:
        raise unknown(name, qualifier)
    users = [item.id for item in draft.all(ALIAS, name) if qualifier in dict(shares(item))]
    if users:
        raise FunctionConflictError(f"Version {qualifier} of {name} is used by the aliases {', '.join(users)[:200]}")
    for kind in (ASYNC, PROVISIONED, POLICY):
        if (setting := draft.get(kind, name, qualifier)) is not None:
            draft.remove(setting)
    draft.remove(version)
    return {}


def _latest(draft: Draft, asked: Mapping[str, Any]) -> Record:
    name, qualifier = parse_function(asked["FunctionName"])
    if qualifier not in ("", LATEST):
        raise FunctionInvalidError("FunctionName: a version never changes; leave the qualifier out")
    record = named(draft, name)
    check_revision(record, asked)
    return record


def _changed(draft: Draft, record: Record, **changes: Any) -> Record:
    """The function with other settings or code; asking for what it has changes the revision all the same."""
    same = all(record.document[key] == value for key, value in changes.items())
    build = record.document["build"] if same else new_revision()
    document = {
        **record.document,
        **changes,
        "build": build,
        "revision": new_revision(),
        "modified_ns": draft.now_ns,
    }
    check_unpacked(document, draft)
    return draft.put(replace(record, document=document))
