"""Functions: what there is, deployed and changed without keys of AWS; versions, aliases and canaries."""

from __future__ import annotations

import asyncio
import base64
import binascii
import contextlib
from typing import Annotated, Any

from fastapi import Query
from pydantic import ValidationError
from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import principal_of, require_all_robots, require_permission
from gateway.api.function_details import describe, detail
from gateway.api.lazy_route import api_router
from gateway.api.listing import After, ListLimit
from gateway.api.middleware.audited import note
from gateway.api.models import functions as m
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.services import Services, services_of
from gateway.api.views.functions import alias_view, canary_view, version_view
from gateway.automation.functions.errors import FunctionInvalidError, NoProvisionedError, UnknownFunctionError
from gateway.domain.automation.canary import Canary
from gateway.errors import InvalidRequestError
from gateway.identity.permissions import permission

__all__ = ["deploy", "router"]

ROLE = "arn:aws:iam::000000000000:role/metaros"  # AWS's model wants one; nothing is assumed here
WINDOW_S = 3600.0
Window = Annotated[float, Query(ge=60.0, le=10_800.0, description="over how long `stats` count, in seconds")]
Search = Annotated[str, Query(max_length=64, description="part of the name")]
ANSWERS: dict[int | str, dict[str, Any]] = {200: {"model": m.FunctionDetail}, **PROBLEMS}

router = api_router("/api/v1/functions", tags=["functions"])


@router.get("", dependencies=[require_permission("functions.read")], responses={200: {"model": m.FunctionList}})
async def list_functions(
    request: Request, q: Search = "", window_s: Window = WINDOW_S, limit: ListLimit = 100, after: After = ""
) -> Response:
    """Every function, by name."""
    services = services_of(request)
    names = sorted(name for name in services.functions.catalogue.names() if q.lower() in name.lower() and name > after)
    page = [await describe(services, name, window_s=window_s) for name in names[:limit]]
    return JsonResponse({"functions": page, "next": names[limit - 1] if len(names) > limit else None})


@router.get("/{name}", dependencies=[require_permission("functions.read")], responses=ANSWERS)
async def get_function(request: Request, name: str, window_s: Window = WINDOW_S) -> Response:
    """One function, with all that belongs to it."""
    return await _answer(request, name, window_s=window_s)


@router.put(
    "/{name}",
    dependencies=[require_permission("functions.write")],
    responses={201: {"model": m.FunctionDetail}, **ANSWERS},
    openapi_extra=body_document(m.Deploy),
)
async def put_function(request: Request, name: str) -> Response:
    """Make a function, or change what the body names of it."""
    require_all_robots(request, "functions")
    raw = await request.body()
    body, code = await asyncio.to_thread(_deployed, raw)  # tens of megabytes of base64 take their time
    made = await deploy(services_of(request), name, body, code)
    note(request, detail=f"{name} {'made' if made else 'changed'}{' with code' if code is not None else ''}")
    return await _answer(request, name, status_code=201 if made else 200)


@router.delete("/{name}", status_code=204, dependencies=[require_permission("functions.write")], responses={**PROBLEMS})
async def delete_function(request: Request, name: str) -> Response:
    """Delete a function with its versions and aliases; events for it become dead letters."""
    require_all_robots(request, "functions")
    await services_of(request).functions.catalogue.do("DeleteFunction", {"FunctionName": name})
    note(request, detail=name)
    return Response(status_code=204)


@router.post(
    "/{name}/versions",
    status_code=201,
    dependencies=[require_permission("functions.write")],
    responses={201: {"model": m.PublishedVersion}, **PROBLEMS},
    openapi_extra=body_document(m.Publish),
)
async def publish_version(request: Request, name: str) -> Response:
    """Make a version of what `$LATEST` is; the one that there is, where nothing changed since."""
    require_all_robots(request, "functions")
    body = await read_body(request, m.Publish)
    asked = {"FunctionName": name, **({"Description": body.description} if body.description else {})}
    made = await services_of(request).functions.catalogue.do("PublishVersion", asked)
    note(request, detail=f"{name} version {made['Version']}")
    return JsonResponse(version_view(made), status_code=201)


@router.put(
    "/{name}/aliases/{alias}",
    dependencies=[require_permission("functions.write")],
    responses={200: {"model": m.Alias}, **PROBLEMS},
    openapi_extra=body_document(m.AliasRequest),
)
async def put_alias(request: Request, name: str, alias: str) -> Response:
    """Let a name lead to a version, and maybe to another one now and then."""
    require_all_robots(request, "functions")
    body = await read_body(request, m.AliasRequest)
    made = await _lead(services_of(request), name, alias, body)
    note(request, detail=f"{name}:{alias} to {body.version}")
    return JsonResponse(alias_view(made, services_of(request).functions.canaries.of(name, alias)))


@router.delete(
    "/{name}/aliases/{alias}",
    status_code=204,
    dependencies=[require_permission("functions.write")],
    responses={**PROBLEMS},
)
async def delete_alias(request: Request, name: str, alias: str) -> Response:
    """Delete an alias."""
    require_all_robots(request, "functions")
    await services_of(request).functions.catalogue.do("DeleteAlias", {"FunctionName": name, "Name": alias})
    note(request, detail=f"{name}:{alias}")
    return Response(status_code=204)


@router.put(
    "/{name}/aliases/{alias}/canary",
    dependencies=[require_permission("functions.write")],
    responses={200: {"model": m.Canary}, **PROBLEMS},
    openapi_extra=body_document(m.CanaryRequest),
)
async def put_canary(request: Request, name: str, alias: str) -> Response:
    """Let an alias lead to a new version now and then; it is rolled back by itself where too many calls fail."""
    require_all_robots(request, "functions")
    body = await read_body(request, m.CanaryRequest)
    by = principal_of(request).name
    asked = Canary(function=name, alias=alias, stable="", by=by, **body.model_dump())
    made = await services_of(request).functions.canaries.begin(asked)
    note(request, detail=f"{name}:{alias} version {made.version} with {made.weight:g}")
    return JsonResponse(canary_view(made))


@router.delete(
    "/{name}/aliases/{alias}/canary",
    dependencies=[require_permission("functions.write")],
    responses={200: {"model": m.Canary}, **PROBLEMS},
)
async def cancel_canary(request: Request, name: str, alias: str) -> Response:
    """Back to the version that the alias had before."""
    require_all_robots(request, "functions")
    ended = await services_of(request).functions.canaries.cancel(name, alias, by=principal_of(request).name)
    note(request, detail=f"{name}:{alias} back at {ended.stable}")
    return JsonResponse(canary_view(ended))


async def deploy(services: Services, name: str, body: m.Deploy, code: Any) -> bool:
    """Make or change a function, with code as bytes or a file, or without; whether it is new."""
    catalogue = services.functions.catalogue
    settings, new = _settings(body), name not in catalogue.names()
    if new:
        if code is None or body.handler is None:
            raise FunctionInvalidError(f"there is no function {name}: a new one needs a zip file and a handler")
        asked = {"FunctionName": name, "Role": ROLE, "Runtime": "python3.11", **settings, "Code": {"ZipFile": code}}
        await catalogue.do("CreateFunction", asked)
    else:
        if settings:
            await catalogue.do("UpdateFunctionConfiguration", {"FunctionName": name, **settings})
        if code is not None:
            await catalogue.do("UpdateFunctionCode", {"FunctionName": name, "ZipFile": code})
    await _bounds(services, name, body)
    if body.publish or body.alias:
        made = await catalogue.do("PublishVersion", {"FunctionName": name})
        if body.alias:
            await _lead(services, name, body.alias, m.AliasRequest(version=made["Version"]))
    await _keep_warm(services, name, body)
    return new


async def _bounds(services: Services, name: str, body: m.Deploy) -> None:
    """Concurrency, and how events are tried."""
    catalogue = services.functions.catalogue
    if body.reserved == -1:
        await catalogue.do("DeleteFunctionConcurrency", {"FunctionName": name})
    elif body.reserved is not None:
        asked = {"FunctionName": name, "ReservedConcurrentExecutions": body.reserved}
        await catalogue.do("PutFunctionConcurrency", asked)
    events, known = body.event_invoke, catalogue.event_invoke(name, "")
    if events is not None:
        ends = {"OnSuccess": (events.on_success, known.on_success), "OnFailure": (events.on_failure, known.on_failure)}
        chosen = {side: old if said is None else said for side, (said, old) in ends.items()}
        tries = known.most_retries if events.most_retries is None else events.most_retries
        age_s = round(known.most_age_s) if events.most_age_s is None else events.most_age_s
        asked = {
            "FunctionName": name,
            "MaximumRetryAttempts": tries,
            "MaximumEventAgeInSeconds": age_s,
            "DestinationConfig": {side: {"Destination": arn} for side, arn in chosen.items() if arn},
        }
        await catalogue.do("PutFunctionEventInvokeConfig", asked)


async def _keep_warm(services: Services, name: str, body: m.Deploy) -> None:
    """Workers that are kept for the alias."""
    if body.warm is None:
        return
    if not body.alias:
        raise FunctionInvalidError("warm: workers are kept for an alias; say which")
    asked: dict[str, Any] = {"FunctionName": name, "Qualifier": body.alias}
    if body.warm:
        asked["ProvisionedConcurrentExecutions"] = body.warm
        await services.functions.catalogue.do("PutProvisionedConcurrencyConfig", asked)
    else:
        with contextlib.suppress(NoProvisionedError, UnknownFunctionError):
            await services.functions.catalogue.do("DeleteProvisionedConcurrencyConfig", asked)


async def _lead(services: Services, name: str, alias: str, body: m.AliasRequest) -> dict[str, Any]:
    """Make an alias, or change where it leads."""
    asked: dict[str, Any] = {"FunctionName": name, "Name": alias, "FunctionVersion": body.version}
    asked["RoutingConfig"] = {"AdditionalVersionWeights": body.weights}
    if body.description is not None:
        asked["Description"] = body.description
    try:
        return await services.functions.catalogue.do("UpdateAlias", asked)
    except UnknownFunctionError:
        return await services.functions.catalogue.do("CreateAlias", asked)


async def _answer(request: Request, name: str, *, window_s: float = WINDOW_S, status_code: int = 200) -> Response:
    principal = principal_of(request)
    secrets = permission("functions.write").granted(principal) and principal.sees_all
    found = await detail(services_of(request), name, window_s=window_s, secrets=secrets)
    return JsonResponse(found, status_code=status_code)


def _deployed(raw: bytes) -> tuple[m.Deploy, bytes | None]:
    """A body, and the code in it."""
    try:
        body = m.Deploy.model_validate_json(raw, strict=True)
    except ValidationError as error:
        faults = "; ".join(f"{'.'.join(map(str, item['loc']))}: {item['msg']}" for item in error.errors())
        raise InvalidRequestError(faults[:1000]) from error
    if body.zip is None:
        return body, None
    try:
        return body, base64.b64decode(body.zip, validate=True)
    except binascii.Error as error:
        raise InvalidRequestError(f"zip: it is no base64: {error}") from error


def _settings(body: m.Deploy) -> dict[str, Any]:
    """The settings that a body names, in AWS's words."""
    plain = {
        "Handler": body.handler,
        "Runtime": body.runtime,
        "Timeout": body.timeout_s,
        "MemorySize": body.memory_mb,
        "Description": body.description,
        "Layers": body.layers,
    }
    found: dict[str, Any] = {key: value for key, value in plain.items() if value is not None}
    if body.disk_mb is not None:
        found["EphemeralStorage"] = {"Size": body.disk_mb}
    if body.event_invoke is not None and body.event_invoke.dead_letter is not None:
        found["DeadLetterConfig"] = {"TargetArn": body.event_invoke.dead_letter}
    if body.environment is not None:
        found["Environment"] = {"Variables": body.environment}
    return found
