"""A version's settings: taken from what a client asks, with AWS's members, checked beyond their shapes, and shown.

What AWS has and Meta-ROS has not is refused by name: a setting that is silently left out would be found out in
production. An empty one ("no VPC") asks for nothing, and is taken.
"""

from __future__ import annotations

import base64
import platform
import secrets
import uuid
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from typing import Any

from gateway.automation.functions.catalogue.names import LATEST, REGION, function_arn, parse_layer_version
from gateway.automation.functions.catalogue.records import LAYER, LAYER_GONE, Records
from gateway.automation.functions.errors import FunctionInvalidError, NotImplementedHereError, UnknownFunctionError
from gateway.store.automation.functions import Record
from metaros.automation.functions.egress.rules import EGRESS, parse_egress
from metaros.errors import FieldError
from metaros.limits import LIMITS

__all__ = ["check_unpacked", "configuration", "layer_of", "new_revision", "shown_sha256", "take_settings", "timestamp"]

MACHINE = {"x86_64": "x86_64", "amd64": "x86_64", "aarch64": "arm64", "arm64": "arm64"}.get(
    platform.machine().lower(), "x86_64"
)
# Those of AWS's reserved names that the runtime sets here; credentials are not among them: a function has none of ours.
RESERVED_NAMES = [
    "AWS_DEFAULT_REGION",
    "AWS_EXECUTION_ENV",
    "AWS_LAMBDA_FUNCTION_MEMORY_SIZE",
    "AWS_LAMBDA_FUNCTION_NAME",
    "AWS_LAMBDA_FUNCTION_VERSION",
    "AWS_LAMBDA_INITIALIZATION_TYPE",
    "AWS_LAMBDA_LOG_FORMAT",
    "AWS_LAMBDA_LOG_GROUP_NAME",
    "AWS_LAMBDA_LOG_LEVEL",
    "AWS_LAMBDA_LOG_STREAM_NAME",
    "AWS_LAMBDA_MAX_CONCURRENCY",
    "AWS_LAMBDA_RUNTIME_API",
    "AWS_REGION",
    "LAMBDA_RUNTIME_DIR",
    "LAMBDA_TASK_ROOT",
]
_USUAL: dict[str, Any] = {
    "Description": "",
    "Timeout": 3,
    "MemorySize": 128,
    "Environment": {},
    "Layers": [],
    "Disk": 512,
    "DeadLetter": "",
    "LogFormat": "Text",
    "LogLevel": "",
}
_PLAIN = ("Role", "Handler", "Description", "Timeout", "MemorySize")
_REFUSED: dict[str, Callable[[Any], Any]] = {
    "VpcConfig": lambda value: any(value.get(name) for name in ("SubnetIds", "SecurityGroupIds")),
    "FileSystemConfigs": bool,
    "ImageConfig": bool,
    "KMSKeyArn": bool,
    "CodeSigningConfigArn": bool,
    "TenancyConfig": bool,
    "CapacityProviderConfig": bool,
    "DurableConfig": bool,
    "RuntimeConfig": bool,
    "AcceleratorConfig": bool,
    "PublishTo": bool,
    "SnapStart": lambda value: value.get("ApplyOn", "None") != "None",
    "TracingConfig": lambda value: value.get("Mode", "PassThrough") != "PassThrough",
    "PackageType": lambda value: value != "Zip",
    "Architectures": lambda value: value != [MACHINE],
}


def take_settings(asked: Mapping[str, Any], records: Records, old: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """The settings that `old` (None: those of a new function) become by what is asked.

    Raises:
        FunctionInvalidError: a setting does not fit; NotImplementedHereError: it is not here.
        UnknownFunctionError: there is no such layer.
    """
    for name, asks in _REFUSED.items():
        if asked.get(name) is not None and asks(asked[name]):
            reason = f": this gateway's machine is {MACHINE}" if name == "Architectures" else ""
            raise NotImplementedHereError(f"{name} {str(asked[name])[:80]} is not implemented by Meta-ROS{reason}")
    settings = dict(_USUAL if old is None else old)
    settings |= {name: asked[name] for name in _PLAIN if asked.get(name) is not None}
    for name, take in _TAKEN.items():
        if asked.get(name) is not None:
            settings |= take(asked[name])
    for name in ("Runtime", "Handler"):
        if not settings.get(name):
            raise FunctionInvalidError(f"{name} is mandatory for functions created with a zip file")
    if asked.get("Layers") is not None:
        settings["Layers"] = _layers(asked["Layers"], records)
    return settings


def check_unpacked(document: Mapping[str, Any], records: Records) -> None:
    """FunctionInvalidError where code and layers together are larger than AWS lets them be."""
    layers = sum(layer_of(arn, records).document["unpacked_bytes"] for arn in document["settings"]["Layers"])
    if (size := document["unpacked_bytes"] + layers) > LIMITS.function_unpacked_bytes:
        raise FunctionInvalidError(
            f"Code combined with layers is {size} bytes unpacked, at most {LIMITS.function_unpacked_bytes} may be"
        )


def configuration(record: Record, records: Records, *, qualifier: str = "") -> dict[str, Any]:
    """What the API shows of a version; `qualifier` is what the ARN is to end with."""
    document, settings = record.document, record.document["settings"]
    version = LATEST if record.id == LATEST else record.id
    shown = {
        "FunctionName": record.owner,
        "FunctionArn": function_arn(record.owner, qualifier),
        "Version": version,
        "Runtime": settings["Runtime"],
        **{name: settings[name] for name in _PLAIN if name in settings},
        "CodeSize": document["code_bytes"],
        "CodeSha256": shown_sha256(document["code"]),
        "LastModified": timestamp(document["modified_ns"]),
        "RevisionId": document["revision"],
        "TracingConfig": {"Mode": "PassThrough"},
        "State": "Active",  # code is stored, checked and unpacked before a change is answered
        "LastUpdateStatus": "Successful",
        "PackageType": "Zip",
        "Architectures": [MACHINE],
        "EphemeralStorage": {"Size": settings["Disk"]},
        "SnapStart": {"ApplyOn": "None", "OptimizationStatus": "Off"},
        "RuntimeVersionConfig": {"RuntimeVersionArn": RUNTIME_VERSION},
        "LoggingConfig": _logging(record.owner, settings),
    }
    if settings["Environment"]:
        shown["Environment"] = {"Variables": dict(settings["Environment"])}
    if settings["DeadLetter"]:
        shown["DeadLetterConfig"] = {"TargetArn": settings["DeadLetter"]}
    if settings["Layers"]:
        shown["Layers"] = [
            {"Arn": arn, "CodeSize": layer_of(arn, records).document["code_bytes"]} for arn in settings["Layers"]
        ]
    return shown


RUNTIME_VERSION = f"arn:aws:lambda:{REGION}::runtime:python-{platform.python_version()}"  # what runs every python3.*


def new_revision() -> str:
    """A RevisionId, or a mapping's UUID."""
    return str(uuid.UUID(bytes=secrets.token_bytes(16), version=4))


def timestamp(wall_ns: int) -> str:
    """A time as Lambda writes it in text."""
    return datetime.fromtimestamp(wall_ns / 1e9, UTC).strftime("%Y-%m-%dT%H:%M:%S.%f")[:-3] + "+0000"


def shown_sha256(digest: str) -> str:
    """A hexadecimal SHA-256 as Lambda writes it."""
    return base64.b64encode(bytes.fromhex(digest)).decode()


def _runtime(name: str) -> dict[str, Any]:
    if not name.startswith("python3."):
        raise NotImplementedHereError(
            f"The runtime {name} is not implemented by Meta-ROS: every python3.* runs, on the gateway's own Python"
            f" {platform.python_version()}"
        )
    return {"Runtime": name}


def _environment(asked: Mapping[str, Any]) -> dict[str, Any]:
    variables = asked.get("Variables") or {}
    if taken := sorted(set(variables) & set(RESERVED_NAMES)):
        raise FunctionInvalidError(f"Environment: these names are the runtime's own: {', '.join(taken)}")
    try:
        parse_egress(variables.get(EGRESS, ""))
    except FieldError as error:
        raise FunctionInvalidError(f"Environment: {error}") from error
    if any("\0" in value for value in variables.values()):
        raise FunctionInvalidError("Environment: no value has a NUL")
    size = sum(len(name.encode()) + len(value.encode("utf-8", "surrogatepass")) for name, value in variables.items())
    if size > LIMITS.function_environment_bytes:
        raise FunctionInvalidError(
            f"Environment has {size} bytes of names and values, at most {LIMITS.function_environment_bytes} may be"
        )
    return {"Environment": dict(variables)}


def _logging_asked(asked: Mapping[str, Any]) -> dict[str, Any]:
    if asked.get("LogGroup"):
        raise NotImplementedHereError(
            "LoggingConfig.LogGroup is not implemented by Meta-ROS: logs are with the function"
        )
    if asked.get("SystemLogLevel"):
        raise NotImplementedHereError("LoggingConfig.SystemLogLevel is not implemented by Meta-ROS")
    form, level = asked.get("LogFormat", "Text"), asked.get("ApplicationLogLevel", "")
    if level and form != "JSON":
        raise FunctionInvalidError("LoggingConfig.ApplicationLogLevel needs LogFormat JSON")
    return {"LogFormat": form, "LogLevel": level}


_TAKEN: dict[str, Callable[[Any], dict[str, Any]]] = {
    "Runtime": _runtime,
    "Environment": _environment,
    "EphemeralStorage": lambda asked: {"Disk": asked["Size"]},
    "DeadLetterConfig": lambda asked: {"DeadLetter": asked.get("TargetArn") or ""},
    "LoggingConfig": _logging_asked,
}


def _layers(arns: list[str], records: Records) -> list[str]:
    if len(arns) > LIMITS.function_layers:
        raise FunctionInvalidError(f"Layers: at most {LIMITS.function_layers} are used by a function")
    names = [parse_layer_version(arn) for arn in arns]
    if len({name.name for name in names}) < len(names):
        raise FunctionInvalidError("Layers: two versions of one layer cannot be used at a time")
    for arn, name in zip(arns, names, strict=True):
        if records.get(LAYER, name.name, str(name.version)) is None:
            raise FunctionInvalidError(f"Layer version {arn} does not exist.")
    return list(arns)


def layer_of(arn: str, records: Records) -> Record:
    """A layer's version that a function has, deleted or not."""
    name = parse_layer_version(arn)
    found = records.get(LAYER, name.name, str(name.version)) or records.get(LAYER_GONE, name.name, str(name.version))
    if found is None:
        raise UnknownFunctionError(f"Layer version {arn} does not exist.")
    return found


def _logging(name: str, settings: Mapping[str, Any]) -> dict[str, Any]:
    shown = {"LogFormat": settings["LogFormat"], "LogGroup": f"/aws/lambda/{name}"}
    return {**shown, "ApplicationLogLevel": settings["LogLevel"]} if settings["LogLevel"] else shown
