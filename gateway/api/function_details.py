"""A function as the API shows it, read together from catalogue, counters, queue, mappings and rules."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Any

from gateway.api.services import Services
from gateway.api.views.functions import alias_view, event_view, function_view, mapping_view, stats_view, version_view
from gateway.automation.functions.async_put import FUNCTION
from gateway.errors import StoreError

__all__ = ["describe", "detail", "every"]

PAGE = 50  # of what the catalogue lists at a time


async def describe(services: Services, name: str, *, window_s: float) -> dict[str, Any]:
    """A function as it is listed."""
    functions = services.functions
    settings = await functions.catalogue.do("GetFunctionConfiguration", {"FunctionName": name})
    aliases = [
        alias_view(item, functions.canaries.of(name, item["Name"]))
        async for item in every(services, "ListAliases", "Aliases", FunctionName=name)
    ]
    versions = [item async for item in every(services, "ListVersionsByFunction", "Versions", FunctionName=name)]
    view = function_view(settings, versions=len(versions) - 1, aliases=aliases)
    return {
        **view,
        "triggers": _triggers(services, name),
        "concurrency": await _concurrency(services, name),
        "stats": await _stats(services, name, window_s),
    }


async def detail(services: Services, name: str, *, window_s: float, secrets: bool) -> dict[str, Any]:
    """A function with all that belongs to it; `secrets`: the values of its environment too."""
    catalogue = services.functions.catalogue
    view = await describe(services, name, window_s=window_s)
    settings = await catalogue.do("GetFunctionConfiguration", {"FunctionName": name})
    variables = settings.get("Environment", {}).get("Variables", {})
    published = [
        version_view(item)
        async for item in every(services, "ListVersionsByFunction", "Versions", FunctionName=name)
        if item["Version"] != "$LATEST"
    ]
    results = {
        item["UUID"]: item.get("LastProcessingResult", "")
        async for item in every(services, "ListEventSourceMappings", "EventSourceMappings", FunctionName=name)
    }
    return {
        **view,
        "environment": variables if secrets else dict.fromkeys(variables, ""),
        "layers": [layer["Arn"] for layer in settings.get("Layers", ())],
        "published": published,
        "event_invoke": event_view(catalogue.event_invoke(name, "")),
        "mappings": [
            mapping_view(row, results.get(row.uuid, "")) for row in catalogue.mappings() if row.function == name
        ],
    }


async def every(services: Services, operation: str, member: str, **asked: Any) -> AsyncIterator[dict[str, Any]]:
    """All that a listing of the catalogue has, page by page."""
    marker = ""
    while True:
        more = {"Marker": marker} if marker else {}
        found = await services.functions.catalogue.do(operation, {**asked, "MaxItems": PAGE, **more})
        for item in found[member]:
            yield item
        marker = found.get("NextMarker", "")
        if not marker:
            return


async def _stats(services: Services, name: str, window_s: float) -> dict[str, Any]:
    functions = services.functions
    waiting, dead = 0, 0
    try:
        backlog = await services.queue.backlog(FUNCTION, name)
        waiting, dead = backlog.waiting + backlog.leased, backlog.dead
    except StoreError:
        pass  # the rest is known without the store
    return stats_view(
        functions.meters.stats(name, window_s=window_s),
        running=functions.invoker.running[name],
        iterator_age_s=functions.mappings.iterator_age_s(name),
        waiting=waiting,
        dead_letters=dead,
    )


async def _concurrency(services: Services, name: str) -> dict[str, Any]:
    catalogue = services.functions.catalogue
    reserved = (await catalogue.do("GetFunctionConcurrency", {"FunctionName": name})).get(
        "ReservedConcurrentExecutions"
    )
    found = await catalogue.do("ListProvisionedConcurrencyConfigs", {"FunctionName": name})
    warm = sum(int(item["RequestedProvisionedConcurrentExecutions"]) for item in found["ProvisionedConcurrencyConfigs"])
    return {"reserved": reserved, "warm": warm}


def _triggers(services: Services, name: str) -> list[dict[str, Any]]:
    found = [
        {"kind": "mapping", "id": row.uuid, "title": row.source_arn, "enabled": row.enabled}
        for row in services.functions.catalogue.mappings()
        if row.function == name
    ]
    for rule in services.rules.registry.rules():
        if any(item.kind == "function" and item.fields["function"] == name for item in rule.targets):
            kind = "schedule" if rule.schedule is not None else "rule"
            found.append({"kind": kind, "id": rule.name, "title": rule.name, "enabled": rule.enabled})
    return found
