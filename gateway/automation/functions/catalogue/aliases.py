"""Aliases: names that lead to a version, or by weights to two."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from gateway.automation.functions.catalogue.lookup import check_revision, named, unknown
from gateway.automation.functions.catalogue.names import LATEST, function_arn, parse_function
from gateway.automation.functions.catalogue.pages import page
from gateway.automation.functions.catalogue.records import ALIAS, ASYNC, POLICY, PROVISIONED, VERSION, Draft, Records
from gateway.automation.functions.catalogue.settings import new_revision
from gateway.automation.functions.errors import FunctionConflictError, FunctionInvalidError, UnknownFunctionError
from gateway.store.automation.functions import Record
from metaros.limits import LIMITS

__all__ = ["change_alias", "create_alias", "delete_alias", "get_alias", "list_aliases", "shares", "update_alias"]


def create_alias(draft: Draft, asked: Mapping[str, Any]) -> dict[str, Any]:
    """A new name for a version."""
    owner, name = _owner(draft, asked), asked["Name"]
    if name.isdigit():
        raise FunctionInvalidError("Name: an alias is not all digits, which would be a version")
    if draft.get(ALIAS, owner, name) is not None:
        raise FunctionConflictError(f"Alias already exists: {function_arn(owner, name)}")
    if len(draft.all(ALIAS, owner)) >= LIMITS.function_aliases:
        raise FunctionInvalidError(f"{owner} has {LIMITS.function_aliases} aliases, which is the bound: delete some")
    record = Record(ALIAS, owner, name, {"version": "", "weights": {}, "description": ""})
    return _view(change_alias(draft, record, asked))


def get_alias(records: Records, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Where it leads."""
    return _view(_alias(records, asked))


def list_aliases(records: Records, asked: Mapping[str, Any]) -> dict[str, Any]:
    """A function's aliases by name, or those of one version."""
    found, version = records.all(ALIAS, _owner(records, asked)), asked.get("FunctionVersion")
    if version:
        found = [item for item in found if version in (item.document["version"], *item.document["weights"])]
    return page(found, asked, "Aliases", _view, key=lambda item: item.id)


def update_alias(draft: Draft, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Let it lead elsewhere."""
    record = _alias(draft, asked)
    check_revision(record, asked, whose="GetAlias")
    return _view(change_alias(draft, record, asked))


def delete_alias(draft: Draft, asked: Mapping[str, Any]) -> dict[str, Any]:
    """It and its settings are gone; no error where there was none, as in AWS."""
    owner = _owner(draft, asked)
    for kind in (ALIAS, ASYNC, PROVISIONED, POLICY):
        if (record := draft.get(kind, owner, asked["Name"])) is not None:
            draft.remove(record)
    return {}


def change_alias(draft: Draft, record: Record, asked: Mapping[str, Any]) -> Record:
    """The alias with what is asked of version, weights and description.

    Raises:
        FunctionInvalidError: a weight or what it leads to does not fit.
        UnknownFunctionError: there is no such version.
    """
    document = dict(record.document)
    if asked.get("FunctionVersion") is not None:
        document["version"] = asked["FunctionVersion"]
    if asked.get("Description") is not None:
        document["description"] = asked["Description"]
    if asked.get("RoutingConfig") is not None:
        document["weights"] = dict(asked["RoutingConfig"].get("AdditionalVersionWeights") or {})
    weights = document["weights"]
    for version in (document["version"], *weights):
        if version != LATEST and draft.get(VERSION, record.owner, version) is None:
            raise unknown(record.owner, version)
    if weights and (len(weights) > 1 or LATEST in (document["version"], *weights) or document["version"] in weights):
        raise FunctionInvalidError("RoutingConfig: weights are for one more version, and none of the two is $LATEST")
    if not all(0 <= share <= 1 for share in weights.values()):
        raise FunctionInvalidError("RoutingConfig: a weight is 0 to 1")
    return draft.put(replace(record, document={**document, "revision": new_revision()}))


def shares(record: Record) -> tuple[tuple[str, float], ...]:
    """The versions that an alias leads to, with how large a part of the calls each gets; they sum to 1."""
    weights: Mapping[str, float] = record.document["weights"]
    return ((record.document["version"], 1.0 - sum(weights.values())), *weights.items())


def _owner(records: Records, asked: Mapping[str, Any]) -> str:
    return named(records, parse_function(asked["FunctionName"]).name).owner


def _alias(records: Records, asked: Mapping[str, Any]) -> Record:
    owner = _owner(records, asked)
    record = records.get(ALIAS, owner, asked["Name"])
    if record is None:
        raise UnknownFunctionError(f"Cannot find alias arn: {function_arn(owner, asked['Name'])}")
    return record


def _view(record: Record) -> dict[str, Any]:
    document = record.document
    shown = {
        "AliasArn": function_arn(record.owner, record.id),
        "Name": record.id,
        "FunctionVersion": document["version"],
        "Description": document["description"],
        "RevisionId": document["revision"],
    }
    return (
        {**shown, "RoutingConfig": {"AdditionalVersionWeights": document["weights"]}} if document["weights"] else shown
    )
