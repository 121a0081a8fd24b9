"""The errors of accounts: what is wrong with a change of users and keys. Their codes are rows of the gateway's table.

RequestError
├── UnknownUserError         there is no such user                              unknown_user
├── UnknownKeyError          there is no such key                               unknown_key
├── UserExistsError          the user's name is taken                           user_exists
├── CredentialsError
│   └── OidcRefusedError     signing in elsewhere came to nothing; says why      bad_credentials
├── ProviderError            the identity provider cannot be asked, or errs     provider_unavailable
└── LastAdminError           nobody could look after the gateway any more       last_admin
"""

from __future__ import annotations

from gateway.errors import CredentialsError, RequestError

__all__ = [
    "LastAdminError",
    "OidcRefusedError",
    "ProviderError",
    "UnknownKeyError",
    "UnknownUserError",
    "UserExistsError",
]


class UnknownUserError(RequestError):
    """There is no user of that name."""

    code = "unknown_user"


class UnknownKeyError(RequestError):
    """There is no such key, or it is somebody else's."""

    code = "unknown_key"


class UserExistsError(RequestError):
    """The name is taken."""

    code = "user_exists"


class LastAdminError(RequestError):
    """The last admin who may sign in cannot be removed, disabled or given a lesser role."""

    code = "last_admin"


class ProviderError(RequestError):
    """The identity provider gives no answer, or one that cannot be used."""

    code = "provider_unavailable"


class OidcRefusedError(CredentialsError):
    """Somebody came back from the identity provider and is not let in; `why` is a word that the sign-in page knows.

    It is one of oidc_denied, oidc_state, oidc_code, oidc_token, oidc_role and oidc_disabled.
    """

    def __init__(self, why: str, message: str) -> None:
        super().__init__(message)
        self.why = why
