"""Signing in at an identity provider: OpenID Connect's code flow with PKCE, state and nonce.

What belongs to one sign-in (state, nonce, verifier) is sealed under the master key into a cookie of the very browser
that began it, so nothing is kept here and nobody can finish a sign-in that somebody else began.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import secrets
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import quote, urlencode

import orjson

from gateway.domain.principal import Role
from gateway.errors import DamagedError
from gateway.identity.errors import OidcRefusedError, ProviderError
from gateway.identity.master import MasterKey
from gateway.identity.oidc.http import UrlPolicy, fetch
from gateway.identity.oidc.settings import OidcSettings
from metaros.clock import Clock
from metaros.lazy_import import LazyModule

if TYPE_CHECKING:
    from joserfc import errors as jose
    from joserfc import jwk, jwt
else:  # most gateways have no provider
    jose, jwk, jwt = LazyModule("joserfc.errors"), LazyModule("joserfc.jwk"), LazyModule("joserfc.jwt")

__all__ = ["OidcClient", "Person", "StartedSignIn"]

ALGORITHMS = ("RS256", "RS384", "RS512", "PS256", "ES256", "ES384", "EdDSA")  # never "none", never a shared secret
DOCUMENT_BYTES = 256 * 1024
BEGUN_S = 600.0
LEEWAY_S = 60
KEPT_S = 300.0  # the provider's documents and keys
_PURPOSE = "oidc"


class StartedSignIn(NamedTuple):
    """A started sign-in: where the browser goes, and what it keeps."""

    url: str
    cookie: str


class Person(NamedTuple):
    """Whom the provider says has signed in: "<issuer> <subject>", a name, and the role of their groups."""

    external: str
    name: str
    role: Role


@dataclass(slots=True)
class _Provider:
    """What the provider says of itself."""

    authorize: str
    token: str
    keys: jwk.KeySet
    read_s: float


class OidcClient:
    """One provider."""

    def __init__(
        self, settings: OidcSettings, master: MasterKey, *, clock: Clock, policy: UrlPolicy | None = None
    ) -> None:
        self.settings = settings
        self._master = master
        self._clock = clock
        self._reach = policy or UrlPolicy(settings.issuer)
        self._provider: _Provider | None = None

    async def begin(self) -> StartedSignIn:
        """Where to send the browser; ProviderError when the provider cannot be asked."""
        provider = await self._known()
        state, nonce, verifier = (secrets.token_urlsafe(32) for _ in range(3))
        expires_ns = self._clock.wall_ns() + round(BEGUN_S * 1e9)
        plain = orjson.dumps({"state": state, "nonce": nonce, "verifier": verifier, "expires_ns": expires_ns})
        query = {
            "response_type": "code",
            "client_id": self.settings.client_id,
            "redirect_uri": self.settings.redirect_url,
            "scope": " ".join(self.settings.scopes),
            "state": state,
            "nonce": nonce,
            "code_challenge": _unpadded(hashlib.sha256(verifier.encode()).digest()),
            "code_challenge_method": "S256",
        }
        join = "&" if "?" in provider.authorize else "?"
        cookie = _unpadded(self._master.seal(_PURPOSE, "begun", plain))
        return StartedSignIn(f"{provider.authorize}{join}{urlencode(query)}", cookie)

    async def finish(self, *, code: str, state: str, cookie: str) -> Person:
        """Who has signed in.

        Raises:
            OidcRefusedError: this browser began no such sign-in, or the provider's answer does not hold.
            ProviderError: the provider cannot be asked.
        """
        begun = self._opened(cookie, state)
        provider = await self._known()
        form = {
            "grant_type": "authorization_code",
            "code": code,
            "redirect_uri": self.settings.redirect_url,
            "client_id": self.settings.client_id,
            "code_verifier": begun["verifier"],
        }
        status, body = await fetch(
            self._reach,
            provider.token,
            limit_bytes=DOCUMENT_BYTES,
            form=urlencode(form).encode(),
            authorization=self._authorization(),
        )
        if status != 200:
            raise OidcRefusedError("oidc_code", "the provider did not take the code: sign in again")
        token = _document(body).get("id_token")
        if not isinstance(token, str):
            raise ProviderError("the provider sent no id_token")
        return self._person(await self._claims(token, begun["nonce"]))

    def _opened(self, cookie: str, state: str) -> dict[str, Any]:
        try:
            sealed = base64.urlsafe_b64decode(cookie + "=" * (-len(cookie) % 4))
            begun: dict[str, Any] = orjson.loads(self._master.open(_PURPOSE, "begun", sealed))
        except (ValueError, DamagedError) as error:
            raise OidcRefusedError("oidc_state", "this browser began no sign-in here: begin again") from error
        same = hmac.compare_digest(begun["state"].encode(), state.encode("utf-8", "replace"))
        if not same or self._clock.wall_ns() >= begun["expires_ns"]:
            raise OidcRefusedError("oidc_state", "this sign-in is another one, or too old: begin again")
        return begun

    def _authorization(self) -> str:
        """The client's own credentials, as RFC 6749 2.3.1 writes them; "" for a public client."""
        own = self.settings
        if not own.client_secret:
            return ""
        pair = f"{quote(own.client_id, safe='')}:{quote(own.client_secret, safe='')}"
        return "Basic " + base64.b64encode(pair.encode()).decode()

    async def _claims(self, token: str, nonce: str) -> dict[str, Any]:
        """The token's claims, when all of them hold; the keys are read again once, as providers change them."""
        provider = await self._known()
        try:
            found = jwt.decode(token, provider.keys, algorithms=list(ALGORITHMS))
        except (jose.JoseError, ValueError):
            provider = await self._known(again=True)
            try:
                found = jwt.decode(token, provider.keys, algorithms=list(ALGORITHMS))
            except (jose.JoseError, ValueError) as error:
                raise OidcRefusedError("oidc_token", "the provider's token is not signed by its keys") from error
        rules = jwt.JWTClaimsRegistry(
            now=self._clock.wall_ns() // 10**9,
            leeway=LEEWAY_S,
            iss={"essential": True, "value": self.settings.issuer},
            aud={"essential": True, "value": self.settings.client_id},
            sub={"essential": True},
            exp={"essential": True},
            iat={"essential": True},
            nonce={"essential": True, "value": nonce},
        )
        try:
            rules.validate(found.claims)
        except (jose.JoseError, ValueError, TypeError) as error:
            raise OidcRefusedError(
                "oidc_token", f"the provider's token is not for this sign-in: {error}"[:300]
            ) from error
        several = isinstance(found.claims["aud"], list) and len(found.claims["aud"]) > 1
        if (several or "azp" in found.claims) and found.claims.get("azp") != self.settings.client_id:
            raise OidcRefusedError("oidc_token", "the provider's token was made for another program")
        return found.claims

    def _person(self, claims: dict[str, Any]) -> Person:
        subject, own = claims["sub"], self.settings
        if not isinstance(subject, str) or not 1 <= len(subject) <= 255:
            raise OidcRefusedError("oidc_token", "the provider's token names nobody")
        role = own.role_of(claims)
        if role is None:
            raise OidcRefusedError("oidc_role", "none of this user's groups has a role here")
        return Person(f"{own.issuer} {subject}", str(claims.get(own.name_claim) or subject), role)

    async def _known(self, *, again: bool = False) -> _Provider:
        now_s = self._clock.monotonic_s()
        if self._provider is None or again or now_s - self._provider.read_s > KEPT_S:
            self._provider = await self._discover(now_s)
        return self._provider

    async def _discover(self, now_s: float) -> _Provider:
        issuer = self.settings.issuer
        said = await self._get(f"{issuer.rstrip('/')}/.well-known/openid-configuration")
        if said.get("issuer") != issuer:
            raise ProviderError(f"what answers at {issuer} calls itself {str(said.get('issuer'))[:200]!r}")
        places = [said.get(name) for name in ("authorization_endpoint", "token_endpoint", "jwks_uri")]
        authorize, token, keys = (str(place) for place in places)
        for place in (authorize, token, keys):
            self._reach.check(place)
        found = (await self._get(keys)).get("keys")
        keys_said = [key for key in found if isinstance(key, dict)] if isinstance(found, list) else []
        usable = [key for key in keys_said if key.get("kty") in ("RSA", "EC", "OKP")]
        try:
            if not usable:
                raise ValueError("there are none")
            return _Provider(authorize, token, jwk.KeySet.import_key_set({"keys": usable}), now_s)
        except (jose.JoseError, ValueError, TypeError, KeyError) as error:
            raise ProviderError("the provider's keys cannot be read") from error

    async def _get(self, url: str) -> dict[str, Any]:
        status, body = await fetch(self._reach, url, limit_bytes=DOCUMENT_BYTES)
        if status != 200:
            raise ProviderError(f"the provider answers {status} at {url[:200]}")
        return _document(body)


def _document(body: bytes) -> dict[str, Any]:
    try:
        found = orjson.loads(body)
    except ValueError as error:
        raise ProviderError("the provider's answer is no JSON") from error
    if not isinstance(found, dict):
        raise ProviderError("the provider's answer is no JSON object")
    return found


def _unpadded(data: bytes) -> str:
    return base64.urlsafe_b64encode(data).decode().rstrip("=")
