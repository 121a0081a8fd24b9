"""How many calls run at a time: reserved for a function, kept warm for a version or alias, and all together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from gateway.automation.functions.catalogue.lookup import named, version_of
from gateway.automation.functions.catalogue.names import LATEST, function_arn, parse_function
from gateway.automation.functions.catalogue.pages import page
from gateway.automation.functions.catalogue.records import FUNCTION, PROVISIONED, VERSION, Draft, Records
from gateway.automation.functions.catalogue.settings import timestamp
from gateway.automation.functions.errors import FunctionInvalidError, NoProvisionedError
from gateway.store.automation.functions import Record
from metaros.limits import LIMITS

__all__ = [
    "delete_function_concurrency",
    "delete_provisioned_concurrency_config",
    "get_account_settings",
    "get_function_concurrency",
    "get_provisioned_concurrency_config",
    "list_provisioned_concurrency_configs",
    "put_function_concurrency",
    "put_provisioned_concurrency_config",
]

UNRESERVED_LEAST = 1  # of all workers: functions without a reservation have to run, too


def put_function_concurrency(draft: Draft, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Reserve, and bound, how many calls of the function run at a time; 0 stops it."""
    record, wanted = _bare(draft, asked), asked["ReservedConcurrentExecutions"]
    left = _unreserved(draft, but=record.owner) - wanted
    if left < UNRESERVED_LEAST:
        raise FunctionInvalidError(
            f"ReservedConcurrentExecutions {wanted} would leave {max(left, 0)} of {LIMITS.function_workers} workers to"
            f" functions without a reservation: at least {UNRESERVED_LEAST} stays"
        )
    if wanted < (warm := sum(item.document["wanted"] for item in draft.all(PROVISIONED, record.owner))):
        raise FunctionInvalidError(f"ReservedConcurrentExecutions {wanted} is under the {warm} that are kept warm")
    draft.put(replace(record, document={**record.document, "reserved": wanted}))
    return {"ReservedConcurrentExecutions": wanted}


def get_function_concurrency(records: Records, asked: Mapping[str, Any]) -> dict[str, Any]:
    """What is reserved, if anything is."""
    reserved = _bare(records, asked).document["reserved"]
    return {} if reserved is None else {"ReservedConcurrentExecutions": reserved}


def delete_function_concurrency(draft: Draft, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Reserve nothing."""
    record = _bare(draft, asked)
    draft.put(replace(record, document={**record.document, "reserved": None}))
    return {}


def put_provisioned_concurrency_config(draft: Draft, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Keep that many workers of a version, or of an alias' main one, ready."""
    owner, qualifier = _qualified(draft, asked)
    wanted, others = asked["ProvisionedConcurrentExecutions"], 0
    for item in draft.all(PROVISIONED):
        others += item.document["wanted"] if (item.owner, item.id) != (owner, qualifier) else 0
    if wanted + others > LIMITS.function_workers - UNRESERVED_LEAST:
        raise FunctionInvalidError(
            f"ProvisionedConcurrentExecutions {wanted}, with {others} elsewhere, is over what"
            f" {LIMITS.function_workers} workers allow"
        )
    reserved = named(draft, owner).document["reserved"]
    if reserved is not None and wanted > reserved:
        raise FunctionInvalidError(f"ProvisionedConcurrentExecutions {wanted} is over the {reserved} that are reserved")
    document = {"wanted": wanted, "modified_ns": draft.now_ns}
    return _provisioned(draft.put(Record(PROVISIONED, owner, qualifier, document)))


def get_provisioned_concurrency_config(records: Records, asked: Mapping[str, Any]) -> dict[str, Any]:
    """What is kept warm; NoProvisionedError where nothing is."""
    return _provisioned(_config(records, asked))


def delete_provisioned_concurrency_config(draft: Draft, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Keep nothing warm."""
    draft.remove(_config(draft, asked))
    return {}


def list_provisioned_concurrency_configs(records: Records, asked: Mapping[str, Any]) -> dict[str, Any]:
    """What is kept warm of a function, by qualifier."""
    owner = _bare(records, asked).owner

    def shown(item: Record) -> dict[str, Any]:
        return {"FunctionArn": function_arn(owner, item.id), **_provisioned(item)}

    return page(
        records.all(PROVISIONED, owner), asked, "ProvisionedConcurrencyConfigs", shown, key=lambda item: item.id
    )


def get_account_settings(records: Records, asked: Mapping[str, Any]) -> dict[str, Any]:
    """The bounds of this gateway, and what is used of them."""
    functions = records.all(FUNCTION)
    sizes = {item.code: item.document["code_bytes"] for item in (*functions, *records.all(VERSION))}
    return {
        "AccountLimit": {
            "TotalCodeSize": LIMITS.function_codes_bytes,
            "CodeSizeUnzipped": LIMITS.function_unpacked_bytes,
            "CodeSizeZipped": LIMITS.function_zip_bytes,
            "ConcurrentExecutions": LIMITS.function_workers,
            "UnreservedConcurrentExecutions": max(0, _unreserved(records)),
        },
        "AccountUsage": {"TotalCodeSize": sum(sizes.values()), "FunctionCount": len(functions)},
    }


def _bare(records: Records, asked: Mapping[str, Any]) -> Record:
    name, qualifier = parse_function(asked["FunctionName"])
    if qualifier:
        raise FunctionInvalidError("FunctionName: this is about the whole function; leave the qualifier out")
    return named(records, name)


def _unreserved(records: Records, *, but: str = "") -> int:
    taken = sum(item.document["reserved"] or 0 for item in records.all(FUNCTION) if item.owner != but)
    return LIMITS.function_workers - taken


def _qualified(records: Records, asked: Mapping[str, Any]) -> tuple[str, str]:
    record, qualifier = version_of(records, asked["FunctionName"], asked["Qualifier"])
    if record.id == LATEST:
        raise FunctionInvalidError(
            "Provisioned Concurrency Configs cannot be applied to unpublished function versions."
        )
    return record.owner, qualifier


def _config(records: Records, asked: Mapping[str, Any]) -> Record:
    owner, qualifier = _qualified(records, asked)
    record = records.get(PROVISIONED, owner, qualifier)
    if record is None:
        raise NoProvisionedError("No Provisioned Concurrency Config found for this function")
    return record


def _provisioned(record: Record) -> dict[str, Any]:
    """READY as soon as it is known: workers are started at once, and a call never waits for the last of them."""
    wanted = record.document["wanted"]
    return {
        "RequestedProvisionedConcurrentExecutions": wanted,
        "AllocatedProvisionedConcurrentExecutions": wanted,
        "AvailableProvisionedConcurrentExecutions": wanted,
        "Status": "READY",
        "LastModified": timestamp(record.document["modified_ns"]),
    }
