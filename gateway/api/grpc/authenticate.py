"""Authorization of every call: who asks, whether the table lets them, how often, and the row in the audit log.

The same table, authenticator, rates and log as REST has, in the same order. A robot's certificate opens nothing here:
it says which machine is connected, and people are known by their keys.
"""

from __future__ import annotations

import logging
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from secrets import token_hex
from typing import Any

import grpc

from gateway.api.authorization import RPC_PERMISSIONS
from gateway.api.grpc.errors import refuse
from gateway.api.middleware.authenticate import Credential, identify
from gateway.api.problem import error_code
from gateway.api.services import Services
from gateway.domain.principal import NOBODY, Principal, anonymous_viewer
from gateway.errors import (
    CredentialsError,
    ForbiddenError,
    RequestError,
    SignInError,
    UnknownRobotError,
    error_row,
)
from gateway.identity.permissions import Permission, permission
from gateway.ingest.link_service import address_of_peer, forwarded, is_local_peer
from gateway.ops.logs import add_log_context
from metaros.errors import MetarosError

__all__ = ["Call", "CallAuthorizer"]

log = logging.getLogger(__name__)

REFUSALS = (401, 403, 429)
Context = grpc.aio.ServicerContext[Any, Any]


@dataclass(slots=True)
class Call:
    """One call that was let in; `detail` goes into its audit row."""

    principal: Principal
    row: Permission
    credential: Credential | None
    services: Services
    detail: str = ""
    robot: str = field(default="")
    status: int = 499  # once it has ended, as HTTP would say it; its caller may go before

    def require(self, robot_id: str) -> None:
        """The robot that it is about: UnknownRobotError out of scope, TooManyRequestsError for too many changes."""
        self.robot = robot_id
        if "\0" in robot_id or not self.principal.sees(robot_id):
            raise UnknownRobotError.of(robot_id)
        if self.row.mutates:
            self.services.rates.take("robot", robot_id)

    async def recheck(self) -> None:
        """CredentialsError when who asked may not be here any more; of long streams."""
        if self.credential is None:
            return
        now = await identify(self.services.authenticator, self.credential)
        if now is None or now.role != self.principal.role or now.robots != self.principal.robots:
            raise CredentialsError("who asked may not have it any more")


class CallAuthorizer:
    """Lets calls in; `services` is asked when the first one comes, as the server is made before the API."""

    def __init__(self, services: Callable[[], Services]) -> None:
        self._services = services

    @asynccontextmanager
    async def call(self, method: str, context: Context) -> AsyncIterator[Call]:
        """One call of a method of `RPC_PERMISSIONS`; whatever goes wrong inside becomes its status."""
        services, row = self._services(), permission(RPC_PERMISSIONS[method])
        call, began_s, number = Call(NOBODY, row, None, services), services.clock.monotonic_s(), token_hex(8)
        add_log_context(lambda: {"request_id": number, "principal": _name(call.principal), "robot": call.robot})
        try:
            if row.mutates:
                services.audit.check_room()
            await self._admit(call, context)
            yield call
        except Exception as error:
            await self._ended(method, call, context, error)
            if not isinstance(error, MetarosError | grpc.aio.AbortError):
                log.exception("%s failed", method)
            await refuse(context, error)
        except BaseException:  # its caller went: what it had begun may be done all the same
            if call.row.mutates and call.principal is not NOBODY:
                services.audit.add(**_facts(method, call, context, status=call.status))
            raise
        else:
            await self._ended(method, call, context, None)
        finally:
            services.meters.rpc(method, call.status, seconds=services.clock.monotonic_s() - began_s)

    async def _admit(self, call: Call, context: Context) -> None:
        services, address = call.services, address_of_peer(context.peer())
        if call.row.who == "anyone":  # what a credential is worth does not matter
            services.rates.take("anonymous", address)
            return
        metadata = {str(key): str(value) for key, value in context.invocation_metadata() or ()}
        call.credential = credential_of(metadata)
        if call.credential is None:
            local = is_local_peer(context.peer()) and not forwarded(context)
            call.principal = anonymous_viewer() if local and services.settings.anonymous_viewers else NOBODY
            services.rates.take("anonymous", address)
        else:
            services.rates.check("refused", address)
            found = await identify(services.authenticator, call.credential)
            if found is None:
                services.rates.count("refused", address)
                raise CredentialsError("this key is not good: wrong, expired or revoked")
            call.principal = found
            services.rates.take("requests", f"{found.kind} {found.id}")
        if not call.row.granted(call.principal):
            raise refusal(call.principal, call.row)

    async def _ended(self, method: str, call: Call, context: Context, error: Exception | None) -> None:
        status, code = 200, ""
        if isinstance(error, MetarosError):
            status, code = error_row(error).http, error_code(error)
        elif error is not None:
            status, code = 500, "internal"
        call.status = status
        facts = _facts(method, call, context, status=status, code=code)
        if status in REFUSALS:
            call.services.audit.refuse(**facts)
        elif call.row.mutates:
            try:
                await call.services.audit.record(**facts)
            except MetarosError as failed:  # it is over, and cannot be taken back
                log.warning("the audit log has no row of %s: %s", method, failed)


def _facts(method: str, call: Call, context: Context, *, status: int, code: str = "") -> dict[str, Any]:
    """A call's row in the audit log."""
    who = call.principal
    return {
        "kind": who.kind,
        "actor": who.id,
        "name": who.name,
        "role": who.role.word,
        "address": address_of_peer(context.peer()),
        "action": call.row.name,
        "method": "GRPC",
        "target": f"{method} {call.robot[:64]}".strip(),
        "status": status,
        "code": code,
        "detail": call.detail,
    }


def _name(who: Principal) -> str:
    return f"{who.kind}:{who.name or who.id}"


def credential_of(metadata: Mapping[str, str]) -> Credential | None:
    """The key in the metadata; None where there is none, CredentialsError for one that cannot be read."""
    said = metadata.get("authorization")
    if said is None:
        return None
    scheme, _, text = said.partition(" ")
    if scheme.lower() != "bearer" or not text.strip():
        raise CredentialsError("authorization is Bearer and a key")
    return Credential("key", text.strip())


def refusal(principal: Principal, row: Permission) -> RequestError:
    """Why somebody may not."""
    if principal.kind == "anonymous":
        return SignInError(f"{row.name} needs a key in the metadata: authorization: Bearer mrk_…")
    return ForbiddenError(f"{row.name} needs the role {row.least.word} or more; this has {principal.role.word}")
