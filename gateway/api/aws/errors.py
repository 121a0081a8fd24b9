"""Why a request to the Lambda API does not count as signed, and the name in AWS's words of whatever is refused.

RequestError
├── UnsignedError              no signature at all, or another credential                       unsigned
├── SignatureIncompleteError   it lacks a part, or does not cover what it has to                signature_incomplete
├── SignatureExpiredError      its time is too far from the gateway's                           signature_expired
├── UnknownAccessKeyError      no key with the scope lambda has this id                         signature_unknown
├── SignatureWrongError        it is not that of this request and key                           signature_wrong
└── LinkExpiredError           a link to code is not good any more                              link_expired
"""

from __future__ import annotations

from typing import NamedTuple

from gateway.errors import RequestError

__all__ = [
    "AWS_ERRORS",
    "AwsError",
    "LinkExpiredError",
    "SignatureExpiredError",
    "SignatureIncompleteError",
    "SignatureWrongError",
    "UnknownAccessKeyError",
    "UnsignedError",
    "aws_error",
]


class UnsignedError(RequestError):
    """The request has no signature of AWS's fourth version in its Authorization header."""

    code = "unsigned"


class SignatureIncompleteError(RequestError):
    """The signature lacks a part, or does not cover what it has to."""

    code = "signature_incomplete"


class SignatureExpiredError(RequestError):
    """The signature was made too long ago, or later than now."""

    code = "signature_expired"


class UnknownAccessKeyError(RequestError):
    """No key with the scope lambda has this id, or not any more."""

    code = "signature_unknown"


class SignatureWrongError(RequestError):
    """The signature is not that of this request and key."""

    code = "signature_wrong"


class LinkExpiredError(RequestError):
    """A link to a function's code is too old, or none of ours."""

    code = "link_expired"


class AwsError(NamedTuple):
    """What AWS calls it, and with which status it comes."""

    name: str
    status: int


_INVALID = AwsError("InvalidParameterValueException", 400)
_DENIED = AwsError("AccessDeniedException", 403)
_MISSING = AwsError("ResourceNotFoundException", 404)
_LARGE = AwsError("RequestTooLargeException", 413)
_BUSY = AwsError("TooManyRequestsException", 429)

# By our code; others have their name by their status, see `aws_error`.
AWS_ERRORS: dict[str, AwsError] = {
    "unsigned": AwsError("MissingAuthenticationTokenException", 403),
    "sign_in": AwsError("MissingAuthenticationTokenException", 403),
    "bad_credentials": AwsError("UnrecognizedClientException", 403),
    "signature_incomplete": AwsError("IncompleteSignatureException", 403),
    "signature_expired": AwsError("InvalidSignatureException", 403),
    "signature_unknown": AwsError("UnrecognizedClientException", 403),
    "signature_wrong": AwsError("InvalidSignatureException", 403),
    "unknown_function": _MISSING,
    "not_found": AwsError("UnknownOperationException", 404),
    "function_conflict": AwsError("ResourceConflictException", 409),
    "function_changed": AwsError("PreconditionFailedException", 412),
    "function_code_full": AwsError("CodeStorageExceededException", 400),
    "function_policy_long": AwsError("PolicyLengthExceededException", 400),
    "function_not_provisioned": AwsError("ProvisionedConcurrencyConfigNotFoundException", 404),
    "function_payload_invalid": AwsError("InvalidRequestContentException", 400),
    "throttled": _BUSY,
    "unsupported_media_type": AwsError("UnsupportedMediaTypeException", 415),
}
_BY_STATUS = {400: _INVALID, 401: _DENIED, 403: _DENIED, 404: _MISSING, 413: _LARGE, 429: _BUSY}


def aws_error(code: str, status: int) -> AwsError:
    """The name of what is refused with that code and status; what nobody named is the service's own fault."""
    if (found := AWS_ERRORS.get(code)) is not None:
        return found
    if 400 <= status < 500:
        return _BY_STATUS.get(status, _INVALID)
    return AwsError("ServiceException", 503 if status == 503 else 500)
