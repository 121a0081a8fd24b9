"""Where a gateway may listen: beyond this machine only with somebody who can sign in, and with a way out said."""

from __future__ import annotations

import os
import shlex
from urllib.parse import urlsplit

from gateway.domain.host_names import is_wildcard, url_of
from gateway.domain.principal import Role
from gateway.settings import DEFAULT_HTTP_PORT, Settings, is_loopback
from gateway.store.accounts.api_keys import key_and_owner, list_keys
from gateway.store.accounts.users import has_admin
from gateway.store.engine import StoreEngine
from metaros.errors import ConfigError
from metaros.limits import LIMITS

__all__ = ["can_sign_in", "check_binding"]


def can_sign_in(engine: StoreEngine, *, now_ns: int) -> bool:
    """Whether somebody can look after the gateway from elsewhere: an admin, or an admin's key that is good."""
    with engine.transaction(write=False):
        return has_admin(engine) or _has_admins_key(engine, now_ns)


def _has_admins_key(engine: StoreEngine, now_ns: int) -> bool:
    admins = [key.id for key in list_keys(engine, limit=LIMITS.keys_listed) if key.role is Role.ADMIN]
    for key, owner in filter(None, (key_and_owner(engine, key_id) for key_id in admins)):
        if owner is None and not (key.expires_ns and now_ns >= key.expires_ns):  # an admin's own would be there above
            return True
    return False


def check_binding(settings: Settings, *, somebody: bool) -> None:
    """ConfigError, with the commands that lead out, when others could connect and nobody could sign in."""
    if is_loopback(settings.host) or somebody or settings.oidc is not None:
        return
    where = _place(settings)
    scheme = "https" if settings.tls_on else "http"
    host = settings.public_host if is_wildcard(settings.host) else settings.host
    url = url_of(scheme, host, settings.port or DEFAULT_HTTP_PORT)
    raise ConfigError(
        f"--host {settings.host}: other machines can connect there, and nobody can sign in yet\n"
        f"make an administrator and start again; the last command prints a sign-in link:\n"
        f"  metaros user add ada --role admin {where}\n"
        f"  metaros signin --user ada {where} --url {url}"
    )


def _place(settings: Settings) -> str:
    """The options by which `metaros user` works in this gateway's store."""
    folder = f"--data-dir {shlex.quote(str(settings.data_dir))}"
    if not settings.store_url:
        return folder
    if settings.store_url == os.environ.get("METAROS_STORE"):
        return folder  # the commands read it from there, too
    hidden = urlsplit(settings.store_url).password or "password" in settings.store_url
    return f"{folder} --store {'URL' if hidden else shlex.quote(settings.store_url)}"
