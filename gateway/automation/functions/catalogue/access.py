"""Tags and policies of functions. A policy is kept and shown; who may call what is decided by roles, as everywhere."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from gateway.automation.functions.catalogue.lookup import named, version_of
from gateway.automation.functions.catalogue.names import LATEST, function_arn, parse_resource
from gateway.automation.functions.catalogue.records import MAPPING, POLICY, Draft, Records
from gateway.automation.functions.catalogue.settings import new_revision
from gateway.automation.functions.errors import (
    FunctionChangedError,
    FunctionConflictError,
    FunctionInvalidError,
    NotImplementedHereError,
    PolicyTooLongError,
    UnknownFunctionError,
)
from gateway.store.automation.functions import Record
from metaros.limits import LIMITS

__all__ = ["add_permission", "get_policy", "list_tags", "remove_permission", "tag_resource", "untag_resource"]


def tag_resource(draft: Draft, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Add tags to a function or a mapping."""
    record = _tagged(draft, asked)
    tags = {**record.document["tags"], **asked["Tags"]}
    if len(tags) > LIMITS.function_tags:
        raise FunctionInvalidError(f"Tags: at most {LIMITS.function_tags} are kept")
    draft.put(replace(record, document={**record.document, "tags": tags}))
    return {}


def untag_resource(draft: Draft, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Take tags away, whether they were there or not."""
    record = _tagged(draft, asked)
    tags = {key: value for key, value in record.document["tags"].items() if key not in asked["TagKeys"]}
    draft.put(replace(record, document={**record.document, "tags": tags}))
    return {}


def list_tags(records: Records, asked: Mapping[str, Any]) -> dict[str, Any]:
    """The tags of a function or a mapping."""
    return {"Tags": dict(_tagged(records, asked).document["tags"])}


def add_permission(draft: Draft, asked: Mapping[str, Any]) -> dict[str, Any]:
    """One more statement of a policy."""
    for name in ("FunctionUrlAuthType", "InvokedViaFunctionUrl"):
        if asked.get(name):
            raise NotImplementedHereError(f"{name} is not implemented by Meta-ROS: functions have no URLs of their own")
    owner, qualifier = _place(draft, asked)
    record = draft.get(POLICY, owner, qualifier) or Record(POLICY, owner, qualifier, {"statements": {}, "revision": ""})
    _check_revision(record, asked)
    statements: dict[str, Any] = dict(record.document["statements"])
    if asked["StatementId"] in statements:
        raise FunctionConflictError(f"The statement id ({asked['StatementId']}) provided already exists.")
    statement = _statement(asked, function_arn(owner, qualifier))
    statements[asked["StatementId"]] = statement
    if len(_text(statements)) > LIMITS.function_policy_bytes:
        raise PolicyTooLongError(f"The policy would have over {LIMITS.function_policy_bytes} characters")
    draft.put(replace(record, document={"statements": statements, "revision": new_revision()}))
    return {"Statement": json.dumps(statement)}


def remove_permission(draft: Draft, asked: Mapping[str, Any]) -> dict[str, Any]:
    """One statement less."""
    record = _policy(draft, asked)
    _check_revision(record, asked)
    statements = dict(record.document["statements"])
    if statements.pop(asked["StatementId"], None) is None:
        raise UnknownFunctionError(f"Statement {asked['StatementId']} is not found in resource policy.")
    if statements:
        draft.put(replace(record, document={"statements": statements, "revision": new_revision()}))
    else:
        draft.remove(record)
    return {}


def get_policy(records: Records, asked: Mapping[str, Any]) -> dict[str, Any]:
    """The policy as text; UnknownFunctionError where there is none."""
    record = _policy(records, asked)
    return {"Policy": _text(record.document["statements"]), "RevisionId": record.document["revision"]}


def _tagged(records: Records, asked: Mapping[str, Any]) -> Record:
    kind, name = parse_resource(asked["Resource"])
    if kind == "function":
        return named(records, name)
    for record in records.all(MAPPING):
        if record.id == name:
            return record
    raise UnknownFunctionError("The resource you requested does not exist.")


def _place(records: Records, asked: Mapping[str, Any]) -> tuple[str, str]:
    record, qualifier = version_of(records, asked["FunctionName"], asked.get("Qualifier") or "")
    if qualifier == LATEST:
        raise FunctionInvalidError("We currently do not support adding policies for $LATEST.")
    return record.owner, qualifier


def _policy(records: Records, asked: Mapping[str, Any]) -> Record:
    owner, qualifier = _place(records, asked)
    record = records.get(POLICY, owner, qualifier)
    if record is None:
        raise UnknownFunctionError("The resource you requested does not exist.")
    return record


def _check_revision(record: Record, asked: Mapping[str, Any]) -> None:
    if asked.get("RevisionId") and asked["RevisionId"] != record.document["revision"]:
        raise FunctionChangedError("The RevisionId provided does not match the latest one: GetPolicy tells it")


def _statement(asked: Mapping[str, Any], arn: str) -> dict[str, Any]:
    who = asked["Principal"]
    shown = "*" if who == "*" else {"Service" if who.endswith(".amazonaws.com") else "AWS": who}
    statement = {
        "Sid": asked["StatementId"],
        "Effect": "Allow",
        "Principal": shown,
        "Action": asked["Action"],
        "Resource": arn,
    }
    condition: dict[str, Any] = {}
    if asked.get("SourceAccount"):
        condition["StringEquals"] = {"AWS:SourceAccount": asked["SourceAccount"]}
    if asked.get("PrincipalOrgID"):
        condition.setdefault("StringEquals", {})["aws:PrincipalOrgID"] = asked["PrincipalOrgID"]
    if asked.get("EventSourceToken"):
        condition.setdefault("StringEquals", {})["lambda:EventSourceToken"] = asked["EventSourceToken"]
    if asked.get("SourceArn"):
        condition["ArnLike"] = {"AWS:SourceArn": asked["SourceArn"]}
    return {**statement, "Condition": condition} if condition else statement


def _text(statements: Mapping[str, Any]) -> str:
    return json.dumps({"Version": "2012-10-17", "Id": "default", "Statement": list(statements.values())})
