"""Every operation of AWS Lambda's API, by its name: what does it here and who may ask, or why it is refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from gateway.automation.functions.catalogue import (
    access,
    aliases,
    concurrency,
    events,
    functions,
    layers,
    mappings,
    versions,
)

__all__ = ["OPERATIONS", "REFUSED", "Operation"]

READ, INVOKE, WRITE = "functions.read", "functions.invoke", "functions.write"


@dataclass(frozen=True, slots=True, kw_only=True)
class Operation:
    """One row. `run` takes records and the members that were asked for, and gives those of the answer: in a
    transaction if it `writes`. None: it is a call of a function, which is not the catalogue's. `code` is the member
    that holds a zip file; its name is "" where the zip is among the members themselves.
    """

    name: str
    permission: str
    run: Callable[[Any, Any], dict[str, Any]] | None = None
    writes: bool = False
    code: str | None = None


def _read(name: str, run: Callable[[Any, Any], dict[str, Any]]) -> Operation:
    return Operation(name=name, permission=READ, run=run)


def _write(name: str, run: Callable[[Any, Any], dict[str, Any]], *, code: str | None = None) -> Operation:
    return Operation(name=name, permission=WRITE, run=run, writes=True, code=code)


_ROWS: tuple[Operation, ...] = (
    Operation(name="Invoke", permission=INVOKE),
    Operation(name="InvokeAsync", permission=INVOKE),
    Operation(name="InvokeWithResponseStream", permission=INVOKE),
    _write("CreateFunction", functions.create_function, code="Code"),
    _read("GetFunction", functions.get_function),
    _read("GetFunctionConfiguration", functions.get_function_configuration),
    _read("ListFunctions", functions.list_functions),
    _write("UpdateFunctionCode", functions.update_function_code, code=""),
    _write("UpdateFunctionConfiguration", functions.update_function_configuration),
    _write("DeleteFunction", functions.delete_function),
    _write("PublishVersion", versions.publish_version),
    _read("ListVersionsByFunction", versions.list_versions_by_function),
    _write("CreateAlias", aliases.create_alias),
    _read("GetAlias", aliases.get_alias),
    _read("ListAliases", aliases.list_aliases),
    _write("UpdateAlias", aliases.update_alias),
    _write("DeleteAlias", aliases.delete_alias),
    _write("PutFunctionConcurrency", concurrency.put_function_concurrency),
    _read("GetFunctionConcurrency", concurrency.get_function_concurrency),
    _write("DeleteFunctionConcurrency", concurrency.delete_function_concurrency),
    _write("PutProvisionedConcurrencyConfig", concurrency.put_provisioned_concurrency_config),
    _read("GetProvisionedConcurrencyConfig", concurrency.get_provisioned_concurrency_config),
    _read("ListProvisionedConcurrencyConfigs", concurrency.list_provisioned_concurrency_configs),
    _write("DeleteProvisionedConcurrencyConfig", concurrency.delete_provisioned_concurrency_config),
    _read("GetAccountSettings", concurrency.get_account_settings),
    _write("PutFunctionEventInvokeConfig", events.put_function_event_invoke_config),
    _write("UpdateFunctionEventInvokeConfig", events.update_function_event_invoke_config),
    _read("GetFunctionEventInvokeConfig", events.get_function_event_invoke_config),
    _read("ListFunctionEventInvokeConfigs", events.list_function_event_invoke_configs),
    _write("DeleteFunctionEventInvokeConfig", events.delete_function_event_invoke_config),
    _write("CreateEventSourceMapping", mappings.create_event_source_mapping),
    _read("GetEventSourceMapping", mappings.get_event_source_mapping),
    _read("ListEventSourceMappings", mappings.list_event_source_mappings),
    _write("UpdateEventSourceMapping", mappings.update_event_source_mapping),
    _write("DeleteEventSourceMapping", mappings.delete_event_source_mapping),
    _write("PublishLayerVersion", layers.publish_layer_version, code="Content"),
    _read("GetLayerVersion", layers.get_layer_version),
    _read("GetLayerVersionByArn", layers.get_layer_version_by_arn),
    _read("ListLayerVersions", layers.list_layer_versions),
    _read("ListLayers", layers.list_layers),
    _write("DeleteLayerVersion", layers.delete_layer_version),
    _write("TagResource", access.tag_resource),
    _write("UntagResource", access.untag_resource),
    _read("ListTags", access.list_tags),
    _write("AddPermission", access.add_permission),
    _write("RemovePermission", access.remove_permission),
    _read("GetPolicy", access.get_policy),
)
OPERATIONS: dict[str, Operation] = {row.name: row for row in _ROWS}

_WHY = {
    "functions have no addresses of their own: put one behind a webhook and a rule": (
        "CreateFunctionUrlConfig",
        "DeleteFunctionUrlConfig",
        "GetFunctionUrlConfig",
        "ListFunctionUrlConfigs",
        "UpdateFunctionUrlConfig",
    ),
    "code is signed on its way to robots, by update targets": (
        "CreateCodeSigningConfig",
        "DeleteCodeSigningConfig",
        "DeleteFunctionCodeSigningConfig",
        "GetCodeSigningConfig",
        "GetFunctionCodeSigningConfig",
        "ListCodeSigningConfigs",
        "ListFunctionsByCodeSigningConfig",
        "PutFunctionCodeSigningConfig",
        "UpdateCodeSigningConfig",
    ),
    "functions run in the gateway's own workers": (
        "CreateCapacityProvider",
        "DeleteCapacityProvider",
        "GetCapacityProvider",
        "GetFunctionScalingConfig",
        "ListCapacityProviders",
        "ListFunctionVersionsByCapacityProvider",
        "PutFunctionScalingConfig",
        "UpdateCapacityProvider",
    ),
    "there are no durable executions": (
        "CheckpointDurableExecution",
        "DeleteDurableExecution",
        "GetDurableExecution",
        "GetDurableExecutionHistory",
        "GetDurableExecutionState",
        "ListDurableExecutionsByFunction",
        "PauseDurableExecution",
        "ResumeDurableExecution",
        "SendDurableExecutionCallbackFailure",
        "SendDurableExecutionCallbackHeartbeat",
        "SendDurableExecutionCallbackSuccess",
        "StopDurableExecution",
    ),
    "roles decide who may do what": (
        "AddLayerVersionPermission",
        "DeleteResourcePolicy",
        "GetLayerVersionPolicy",
        "GetResourcePolicy",
        "PutResourcePolicy",
        "RemoveLayerVersionPermission",
    ),
    "a function does not call itself through anything that would see it": (
        "GetFunctionRecursionConfig",
        "PutFunctionRecursionConfig",
    ),
    "every python3.* runs on the gateway's own Python": (
        "GetRuntimeManagementConfig",
        "PutRuntimeManagementConfig",
    ),
}
REFUSED: dict[str, str] = {name: why for why, names in _WHY.items() for name in names}
