"""Names of functions and layers in every form that AWS takes them: a name, a part of an ARN, a whole ARN."""

from __future__ import annotations

import re
from typing import NamedTuple

from gateway.automation.functions.errors import FunctionInvalidError, UnknownFunctionError

__all__ = [
    "ACCOUNT",
    "LATEST",
    "REGION",
    "FunctionName",
    "LayerName",
    "function_arn",
    "layer_arn",
    "mapping_arn",
    "parse_function",
    "parse_layer",
    "parse_layer_version",
    "parse_resource",
]

REGION, ACCOUNT, LATEST = "local", "000000000000", "$LATEST"
_ARN = f"arn:aws:lambda:{REGION}:{ACCOUNT}"
_FUNCTION = re.compile(
    r"(?:(?:arn:aws[a-z-]*:lambda:[a-z0-9-]+:)?(?P<account>[0-9]{12}):function:|function:)?"
    r"(?P<name>[A-Za-z0-9_-]{1,64})(?::(?P<qualifier>\$LATEST|[A-Za-z0-9_-]{1,128}))?"
)
_LAYER = re.compile(
    r"(?:arn:aws[a-z-]*:lambda:[a-z0-9-]+:(?P<account>[0-9]{12}):layer:)?"
    r"(?P<name>[A-Za-z0-9_-]{1,64})(?::(?P<version>[0-9]{1,9}))?"
)
_MAPPING = re.compile(r"arn:aws[a-z-]*:lambda:[a-z0-9-]+:[0-9]{12}:event-source-mapping:(?P<uuid>[0-9a-f-]{36})")


class FunctionName(NamedTuple):
    """A function and which of its versions or aliases; "" where none was named."""

    name: str
    qualifier: str = ""


class LayerName(NamedTuple):
    """A layer and one of its versions; 0 where none was named."""

    name: str
    version: int = 0


def function_arn(name: str, qualifier: str = "") -> str:
    """The ARN of a function, or of a version or alias of it."""
    return f"{_ARN}:function:{name}" + (f":{qualifier}" if qualifier else "")


def layer_arn(name: str, version: int = 0) -> str:
    """The ARN of a layer, or of a version of it."""
    return f"{_ARN}:layer:{name}" + (f":{version}" if version else "")


def mapping_arn(uuid: str) -> str:
    """The ARN of an event source mapping."""
    return f"{_ARN}:event-source-mapping:{uuid}"


def parse_function(text: str, qualifier: str = "") -> FunctionName:
    """What `text` names; a qualifier may stand in it, or beside it.

    Raises:
        FunctionInvalidError: it is no name, or names two qualifiers.
        UnknownFunctionError: it is somebody else's account.
    """
    match = _FUNCTION.fullmatch(text)
    if match is None:
        raise FunctionInvalidError(
            f"FunctionName {text[:80]!r} is no name: 1 to 64 of a-z, A-Z, 0-9, '-' and '_', or the ARN of one"
        )
    _check_account(match["account"], text)
    said = match["qualifier"] or ""
    if said and qualifier and said != qualifier:
        raise FunctionInvalidError(
            "The derived qualifier from the function name does not match the specified qualifier."
        )
    return FunctionName(match["name"], said or qualifier)


def parse_layer(text: str) -> LayerName:
    """What `text` names; FunctionInvalidError for what is no layer's name, UnknownFunctionError for another account."""
    match = _LAYER.fullmatch(text)
    if match is None:
        raise FunctionInvalidError(
            f"LayerName {text[:80]!r} is no name: 1 to 64 of a-z, A-Z, 0-9, '-' and '_', or the ARN of one"
        )
    _check_account(match["account"], text)
    return LayerName(match["name"], int(match["version"] or 0))


def parse_layer_version(arn: str) -> LayerName:
    """A layer's version by its ARN, nothing less; FunctionInvalidError."""
    found = parse_layer(arn)
    if not found.version or not arn.startswith("arn:"):
        raise FunctionInvalidError(f"{arn[:120]!r} is no ARN of a layer's version")
    return found


def parse_resource(arn: str) -> tuple[str, str]:
    """What has tags: ("function", its name) or ("mapping", its UUID)."""
    if match := _MAPPING.fullmatch(arn):
        return "mapping", match["uuid"]
    found = parse_function(arn)
    if not arn.startswith("arn:") or found.qualifier:
        raise FunctionInvalidError("tags belong to the ARN of a function without a qualifier, or of a mapping")
    return "function", found.name


def _check_account(account: str | None, text: str) -> None:
    if account is not None and account != ACCOUNT:
        raise UnknownFunctionError(f"{text[:160]} is not here: this gateway's account is {ACCOUNT}")
