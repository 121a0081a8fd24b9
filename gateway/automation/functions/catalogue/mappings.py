"""Event source mappings: which topics of which robots call a function, in which batches."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from datetime import datetime
from typing import Any

from gateway.automation.functions.catalogue.lookup import version_of
from gateway.automation.functions.catalogue.names import function_arn, mapping_arn, parse_function
from gateway.automation.functions.catalogue.pages import page
from gateway.automation.functions.catalogue.records import MAPPING, Draft, Records
from gateway.automation.functions.catalogue.settings import new_revision
from gateway.automation.functions.directory import MappingRow
from gateway.automation.functions.errors import (
    FunctionConflictError,
    FunctionInvalidError,
    NotImplementedHereError,
    UnknownFunctionError,
)
from gateway.automation.functions.topic_arn import parse_topic_arn
from gateway.store.automation.functions import Record
from metaros.automation.rules.errors import PatternError
from metaros.automation.rules.pattern import compile_pattern
from metaros.limits import LIMITS

__all__ = [
    "create_event_source_mapping",
    "delete_event_source_mapping",
    "get_event_source_mapping",
    "list_event_source_mappings",
    "mapping_row",
    "update_event_source_mapping",
]

_USUAL: dict[str, Any] = {
    "BatchSize": 100,
    "MaximumBatchingWindowInSeconds": 0,
    "ParallelizationFactor": 1,
    "MaximumRecordAgeInSeconds": -1,
    "MaximumRetryAttempts": -1,
    "BisectBatchOnFunctionError": False,
    "FunctionResponseTypes": [],
    "Filters": [],
    "OnFailure": "",
    "Enabled": True,
}
_PLAIN = (
    "BatchSize",
    "MaximumBatchingWindowInSeconds",
    "ParallelizationFactor",
    "MaximumRecordAgeInSeconds",
    "MaximumRetryAttempts",
    "BisectBatchOnFunctionError",
    "FunctionResponseTypes",
    "Enabled",
)
_REFUSED = (
    "KMSKeyArn",
    "MetricsConfig",
    "LoggingConfig",
    "ScalingConfig",
    "TumblingWindowInSeconds",
    "Topics",
    "Queues",
    "SourceAccessConfigurations",
    "SelfManagedEventSource",
    "AmazonManagedKafkaEventSourceConfig",
    "SelfManagedKafkaEventSourceConfig",
    "DocumentDBEventSourceConfig",
    "ProvisionedPollerConfig",
)


def create_event_source_mapping(draft: Draft, asked: Mapping[str, Any]) -> dict[str, Any]:
    """A new one; of one source and function there is one."""
    if not asked.get("EventSourceArn"):
        raise FunctionInvalidError("EventSourceArn is required: arn:aws:metaros:::topic/ROBOTS/TOPIC")
    parse_topic_arn(asked["EventSourceArn"])
    owner, qualifier = _function(draft, asked)
    for item in draft.all(MAPPING, owner):
        if (item.document["source"], item.document["qualifier"]) == (asked["EventSourceArn"], qualifier):
            raise FunctionConflictError(
                f"An event source mapping with this source and function exists already: UUID {item.id}"
            )
    if len(draft.all(MAPPING)) >= LIMITS.function_mappings:
        raise FunctionInvalidError(f"There are {LIMITS.function_mappings} event source mappings, which is the bound")
    document = {
        **_USUAL,
        "source": asked["EventSourceArn"],
        "qualifier": qualifier,
        **_start(asked),
        **_taken(asked),
        "modified_ns": draft.now_ns,
        "tags": dict(asked.get("Tags") or {}),
    }
    return _view(draft.put(Record(MAPPING, owner, new_revision(), document)), "Creating")


def get_event_source_mapping(records: Records, asked: Mapping[str, Any]) -> dict[str, Any]:
    """One of them."""
    return _view(_found(records, asked))


def list_event_source_mappings(records: Records, asked: Mapping[str, Any]) -> dict[str, Any]:
    """All of them, or those of a source, of a function."""
    name = parse_function(asked["FunctionName"]) if asked.get("FunctionName") else None
    found = records.all(MAPPING, name.name if name is not None else None)
    if name is not None and name.qualifier:
        found = [item for item in found if item.document["qualifier"] == name.qualifier]
    if source := asked.get("EventSourceArn"):
        found = [item for item in found if item.document["source"] == source]
    return page(sorted(found, key=lambda item: item.id), asked, "EventSourceMappings", _view, key=lambda item: item.id)


def update_event_source_mapping(draft: Draft, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Other settings, or another function."""
    record = _found(draft, asked)
    document = {**record.document, **_taken(asked), "modified_ns": draft.now_ns}
    if asked.get("FunctionName"):
        owner, document["qualifier"] = _function(draft, asked)
        if owner != record.owner:
            draft.remove(record)
            record = replace(record, owner=owner)
    return _view(draft.put(replace(record, document=document)), "Updating")


def delete_event_source_mapping(draft: Draft, asked: Mapping[str, Any]) -> dict[str, Any]:
    """It is gone at once; what it has put into the queue is still delivered."""
    record = _found(draft, asked)
    draft.remove(record)
    return _view(record, "Deleting")


def mapping_row(record: Record) -> MappingRow:
    """As those who poll want it."""
    document = record.document
    return MappingRow(
        uuid=record.id,
        source_arn=document["source"],
        function=record.owner,
        qualifier=document["qualifier"],
        enabled=document["Enabled"],
        batch_size=document["BatchSize"],
        window_s=float(document["MaximumBatchingWindowInSeconds"]),
        filters=tuple(json.loads(text) for text in document["Filters"]),
        most_retries=document["MaximumRetryAttempts"],
        most_age_s=float(document["MaximumRecordAgeInSeconds"]),
        bisect=document["BisectBatchOnFunctionError"],
        report_failures=bool(document["FunctionResponseTypes"]),
        parallel=document["ParallelizationFactor"],
        on_failure=document["OnFailure"],
        start=document["start"],
        start_ns=document["start_ns"],
    )


def _taken(asked: Mapping[str, Any]) -> dict[str, Any]:
    for name in _REFUSED:
        if asked.get(name):
            raise NotImplementedHereError(f"{name} is not implemented by Meta-ROS: sources are topics of robots")
    taken = {name: asked[name] for name in _PLAIN if asked.get(name) is not None}
    if asked.get("FilterCriteria") is not None:
        taken["Filters"] = _filters(asked["FilterCriteria"])
    if asked.get("DestinationConfig") is not None:
        destinations = asked["DestinationConfig"]
        if (destinations.get("OnSuccess") or {}).get("Destination"):
            raise FunctionInvalidError("DestinationConfig.OnSuccess is not for event source mappings")
        taken["OnFailure"] = (destinations.get("OnFailure") or {}).get("Destination") or ""
    return taken


def _filters(asked: Mapping[str, Any]) -> list[str]:
    texts = [item.get("Pattern") or "{}" for item in asked.get("Filters") or ()]
    if len(texts) > LIMITS.mapping_filters:
        raise FunctionInvalidError(f"FilterCriteria.Filters: at most {LIMITS.mapping_filters}")
    for number, text in enumerate(texts):
        try:
            compile_pattern(json.loads(text))
        except (ValueError, TypeError, RecursionError, PatternError) as error:
            raise FunctionInvalidError(f"FilterCriteria.Filters[{number}].Pattern: {error}") from error
    return texts


def _start(asked: Mapping[str, Any]) -> dict[str, Any]:
    start, at = asked.get("StartingPosition") or "LATEST", asked.get("StartingPositionTimestamp")
    if (start == "AT_TIMESTAMP") != (at is not None):
        raise FunctionInvalidError("StartingPositionTimestamp belongs to StartingPosition AT_TIMESTAMP")
    seconds = at.timestamp() if isinstance(at, datetime) else at
    return {"start": start, "start_ns": 0 if seconds is None else round(seconds * 1e9)}


def _function(records: Records, asked: Mapping[str, Any]) -> tuple[str, str]:
    record, qualifier = version_of(records, asked["FunctionName"])
    return record.owner, qualifier


def _found(records: Records, asked: Mapping[str, Any]) -> Record:
    for record in records.all(MAPPING):
        if record.id == asked["UUID"]:
            return record
    raise UnknownFunctionError("The resource you requested does not exist.")


def _view(record: Record, state: str = "") -> dict[str, Any]:
    document = record.document
    shown = {
        "UUID": record.id,
        "EventSourceMappingArn": mapping_arn(record.id),
        "EventSourceArn": document["source"],
        "FunctionArn": function_arn(record.owner, document["qualifier"]),
        "StartingPosition": document["start"],
        "State": state or ("Enabled" if document["Enabled"] else "Disabled"),
        "StateTransitionReason": "USER_INITIATED",
        "LastModified": document["modified_ns"] / 1e9,
        "DestinationConfig": {"OnFailure": {"Destination": document["OnFailure"]} if document["OnFailure"] else {}},
        **{name: document[name] for name in _PLAIN if name != "Enabled"},
    }
    if document["start_ns"]:
        shown["StartingPositionTimestamp"] = document["start_ns"] / 1e9
    if document["Filters"]:
        shown["FilterCriteria"] = {"Filters": [{"Pattern": text} for text in document["Filters"]]}
    return shown
