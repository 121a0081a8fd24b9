"""Layers: zip files that several functions have beside their own code, in versions that never change."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gateway.automation.functions.catalogue.code import CodeFacts
from gateway.automation.functions.catalogue.names import LayerName, layer_arn, parse_layer, parse_layer_version
from gateway.automation.functions.catalogue.pages import page
from gateway.automation.functions.catalogue.records import (
    FUNCTION,
    LAYER,
    LAYER_GONE,
    LAYER_NAME,
    VERSION,
    Draft,
    Records,
)
from gateway.automation.functions.catalogue.settings import shown_sha256, timestamp
from gateway.automation.functions.errors import FunctionInvalidError, UnknownFunctionError
from gateway.store.automation.functions import Record
from metaros.limits import LIMITS

__all__ = [
    "delete_layer_version",
    "forget_layers",
    "get_layer_version",
    "get_layer_version_by_arn",
    "list_layer_versions",
    "list_layers",
    "publish_layer_version",
]

_PLAIN = ("Description", "CompatibleArchitectures", "CompatibleRuntimes", "LicenseInfo")


def publish_layer_version(draft: Draft, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Another version; a number is never used again, not even after it was deleted."""
    name = parse_layer(asked["LayerName"])
    if name.version:
        raise FunctionInvalidError("LayerName: a version's number is given, not asked for")
    if len(draft.all(LAYER)) >= LIMITS.function_layer_versions:
        raise FunctionInvalidError(f"There are {LIMITS.function_layer_versions} layer versions, which is the bound")
    counted = draft.get(LAYER_NAME, name.name, "")
    number = int(counted.document["next"]) if counted is not None else 1
    draft.put(Record(LAYER_NAME, name.name, "", {"next": number + 1}))
    code: CodeFacts = asked["Content"]
    said = {key: asked[key] for key in _PLAIN if asked.get(key) is not None}
    document = {**code.document, "said": said, "modified_ns": draft.now_ns}
    return _view(draft.put(Record(LAYER, name.name, str(number), document)), content=True)


def get_layer_version(records: Records, asked: Mapping[str, Any]) -> dict[str, Any]:
    """One version, with where its code can be fetched."""
    return _view(_found(records, _numbered(asked)), content=True)


def get_layer_version_by_arn(records: Records, asked: Mapping[str, Any]) -> dict[str, Any]:
    """The same by its ARN."""
    return _view(_found(records, parse_layer_version(asked["Arn"])), content=True)


def list_layer_versions(records: Records, asked: Mapping[str, Any]) -> dict[str, Any]:
    """A layer's versions, the newest first."""
    found = _fitting(records.all(LAYER, parse_layer(asked["LayerName"]).name), asked)
    found.sort(key=_newest_first)
    return page(found, asked, "LayerVersions", _view, key=_newest_first)


def list_layers(records: Records, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Every layer with its newest version."""
    newest: dict[str, Record] = {}
    for record in sorted(_fitting(records.all(LAYER), asked), key=lambda item: int(item.id)):
        newest[record.owner] = record

    def shown(item: Record) -> dict[str, Any]:
        return {"LayerName": item.owner, "LayerArn": layer_arn(item.owner), "LatestMatchingVersion": _view(item)}

    return page([newest[name] for name in sorted(newest)], asked, "Layers", shown, key=lambda item: item.owner)


def delete_layer_version(draft: Draft, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Nobody can choose it any more; functions that have it keep it. No error where there is none, as in AWS."""
    name = _numbered(asked)
    record = draft.get(LAYER, name.name, str(name.version))
    if record is not None:
        draft.put(Record(LAYER_GONE, record.owner, record.id, record.document))
        draft.remove(record)
    return {}


def forget_layers(draft: Draft) -> None:
    """Let go of deleted versions that no function has any more."""
    users = [*draft.all(FUNCTION), *draft.all(VERSION)]
    names = {parse_layer_version(arn) for item in users for arn in item.document["settings"]["Layers"]}
    for record in draft.all(LAYER_GONE):
        if LayerName(record.owner, int(record.id)) not in names:
            draft.remove(record)


def _numbered(asked: Mapping[str, Any]) -> LayerName:
    name = parse_layer(asked["LayerName"])
    if name.version:
        raise FunctionInvalidError("LayerName: its version is given by VersionNumber")
    return LayerName(name.name, asked["VersionNumber"])


def _found(records: Records, name: LayerName) -> Record:
    record = records.get(LAYER, name.name, str(name.version))
    if record is None:
        raise UnknownFunctionError("The resource you requested does not exist.")
    return record


def _fitting(found: list[Record], asked: Mapping[str, Any]) -> list[Record]:
    """Those that say that they fit a runtime and a machine, if any is asked for."""
    for key, name in (
        ("CompatibleRuntimes", "CompatibleRuntime"),
        ("CompatibleArchitectures", "CompatibleArchitecture"),
    ):
        if wanted := asked.get(name):
            found = [item for item in found if wanted in item.document["said"].get(key, ())]
    return found


def _newest_first(record: Record) -> str:
    return f"{10**9 - int(record.id):010d}"


def _view(record: Record, *, content: bool = False) -> dict[str, Any]:
    document = record.document
    shown = {
        "LayerVersionArn": layer_arn(record.owner, int(record.id)),
        "Version": int(record.id),
        "CreatedDate": timestamp(document["modified_ns"]),
        **document["said"],
    }
    if content:
        place = {"Location": document["code"], "CodeSha256": shown_sha256(document["code"])}
        shown |= {"LayerArn": layer_arn(record.owner), "Content": {**place, "CodeSize": document["code_bytes"]}}
    return shown
