"""Records as those want them who run functions."""

from __future__ import annotations

from pathlib import Path

from gateway.automation.functions.catalogue.names import LATEST, function_arn
from gateway.automation.functions.catalogue.records import ALIAS, FUNCTION, PROVISIONED, Records
from gateway.automation.functions.directory import EventInvoke
from gateway.store.automation.functions import Record
from metaros.automation.functions.calls import FunctionSpec
from metaros.limits import LIMITS

__all__ = ["event_settings", "make_spec"]


def make_spec(record: Record, records: Records, *, code_dir: Path, layer_dirs: tuple[Path, ...]) -> FunctionSpec:
    """A version as the engine runs it. Its key is another one whenever what runs is, or how much of it is kept warm."""
    settings, name, version = record.document["settings"], record.owner, record.id
    latest = records.get(FUNCTION, name, LATEST)
    warm = _warm(record, records)
    environment = dict(settings["Environment"])
    if settings["LogFormat"] != "Text":
        environment |= {"AWS_LAMBDA_LOG_FORMAT": settings["LogFormat"], "AWS_LAMBDA_LOG_LEVEL": settings["LogLevel"]}
    return FunctionSpec(
        key=f"{name}:{version}:{record.document['build']}:{warm}",
        name=name,
        version=version,
        arn=function_arn(name, version),
        handler=settings["Handler"],
        code_dir=code_dir,
        runtime=settings["Runtime"],
        layer_dirs=layer_dirs,
        environment=environment,
        timeout_s=float(settings["Timeout"]),
        memory_mb=settings["MemorySize"],
        disk_mb=settings["Disk"],
        min_workers=warm,
        max_workers=LIMITS.function_workers,
        reserved=latest.document["reserved"] if latest is not None else None,
    )


def event_settings(latest: Record | None, config: Record | None) -> EventInvoke:
    """How events are tried; the usual where nothing is set."""
    dead_letter = latest.document["settings"]["DeadLetter"] if latest is not None else ""
    document = config.document if config is not None else {}
    ends = {key: (value or {}).get("Destination") or "" for key, value in document.get("DestinationConfig", {}).items()}
    return EventInvoke(
        most_retries=document.get("MaximumRetryAttempts", 2),
        most_age_s=float(document.get("MaximumEventAgeInSeconds", 21_600)),
        on_success=ends.get("OnSuccess", ""),
        on_failure=ends.get("OnFailure", ""),
        dead_letter=dead_letter,
    )


def _warm(record: Record, records: Records) -> int:
    """Kept warm for the version itself, and for every alias whose main version it is."""
    found = 0
    for item in records.all(PROVISIONED, record.owner):
        alias = records.get(ALIAS, record.owner, item.id)
        if item.id == record.id or (alias is not None and alias.document["version"] == record.id):
            found += item.document["wanted"]
    return found
