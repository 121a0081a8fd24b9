"""What becomes of events for a function: how often they are tried, how old they may get, who is told of the end."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from gateway.automation.functions.catalogue.lookup import named, version_of
from gateway.automation.functions.catalogue.names import LATEST, function_arn, parse_function
from gateway.automation.functions.catalogue.pages import page
from gateway.automation.functions.catalogue.records import ASYNC, Draft, Records
from gateway.automation.functions.errors import UnknownFunctionError
from gateway.store.automation.functions import Record

__all__ = [
    "delete_function_event_invoke_config",
    "get_function_event_invoke_config",
    "list_function_event_invoke_configs",
    "put_function_event_invoke_config",
    "update_function_event_invoke_config",
]

_MEMBERS = ("MaximumRetryAttempts", "MaximumEventAgeInSeconds", "DestinationConfig")


def put_function_event_invoke_config(draft: Draft, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Just these settings: what is not asked for is as usual again."""
    owner, qualifier = _place(draft, asked)
    return _kept(draft, Record(ASYNC, owner, qualifier, {}), asked)


def update_function_event_invoke_config(draft: Draft, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Other settings where they are asked for."""
    return _kept(draft, _config(draft, asked), asked)


def get_function_event_invoke_config(records: Records, asked: Mapping[str, Any]) -> dict[str, Any]:
    """The settings."""
    return _view(_config(records, asked))


def delete_function_event_invoke_config(draft: Draft, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Everything as usual."""
    draft.remove(_config(draft, asked))
    return {}


def list_function_event_invoke_configs(records: Records, asked: Mapping[str, Any]) -> dict[str, Any]:
    """The settings of a function's versions and aliases."""
    owner = named(records, parse_function(asked["FunctionName"]).name).owner
    found = records.all(ASYNC, owner)
    return page(found, asked, "FunctionEventInvokeConfigs", _view, key=lambda item: item.id)


def _place(records: Records, asked: Mapping[str, Any]) -> tuple[str, str]:
    record, qualifier = version_of(records, asked["FunctionName"], asked.get("Qualifier") or "")
    return record.owner, qualifier or LATEST


def _config(records: Records, asked: Mapping[str, Any]) -> Record:
    owner, qualifier = _place(records, asked)
    record = records.get(ASYNC, owner, qualifier)
    if record is None:
        raise UnknownFunctionError(f"The function {function_arn(owner, qualifier)} doesn't have an EventInvokeConfig")
    return record


def _kept(draft: Draft, record: Record, asked: Mapping[str, Any]) -> dict[str, Any]:
    wanted = {name: asked[name] for name in _MEMBERS if asked.get(name) is not None}
    return _view(draft.put(replace(record, document={**record.document, **wanted, "modified_ns": draft.now_ns})))


def _view(record: Record) -> dict[str, Any]:
    document = record.document
    return {
        "FunctionArn": function_arn(record.owner, record.id),
        "LastModified": document["modified_ns"] / 1e9,
        **{name: document[name] for name in _MEMBERS if name in document},
        "DestinationConfig": {"OnSuccess": {}, "OnFailure": {}, **document.get("DestinationConfig", {})},
    }
