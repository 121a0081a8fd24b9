"""URLs of object stores: "" the data directory, file:///folder, or s3://bucket/prefix."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import parse_qs, unquote, urlsplit

from metaros.errors import ConfigError

__all__ = ["BucketUrl", "check_objects_url", "parse_objects_url"]

FORMS = "--objects is file:///folder or s3://bucket/prefix?endpoint=https://host:port&region=name"
OPTIONS = ("endpoint", "region")


@dataclass(frozen=True, slots=True)
class BucketUrl:
    """A bucket; "" leaves endpoint and region to the environment of AWS's own tools."""

    bucket: str
    prefix: str
    endpoint: str
    region: str

    @property
    def where(self) -> str:
        """What people call it."""
        place = f"s3://{self.bucket}/{self.prefix}".rstrip("/")
        return f"{place} at {self.endpoint}" if self.endpoint else place


def check_objects_url(url: str) -> None:
    """ConfigError when no object store is at this URL."""
    parse_objects_url(url)


def parse_objects_url(url: str) -> Path | BucketUrl | None:
    """What the URL names; None where it is empty. ConfigError when no object store is at it."""
    if not url:
        return None
    try:
        return _read(url)
    except ValueError as error:  # of brackets, ports and options that are none
        raise ConfigError(f"--objects: {error}\n{FORMS}") from error


def _read(url: str) -> Path | BucketUrl:
    parts = urlsplit(url)
    if parts.scheme == "file" and parts.netloc in ("", "localhost") and parts.path and not parts.query:
        return Path(unquote(parts.path))
    if parts.scheme != "s3":
        raise ConfigError(FORMS)
    options = parse_qs(parts.query, strict_parsing=bool(parts.query))
    unknown = sorted(options.keys() - set(OPTIONS))
    if unknown:
        raise ConfigError(f"--objects knows no option {unknown[0]}\n{FORMS}")
    found = BucketUrl(parts.netloc, unquote(parts.path).strip("/"), *(options.get(key, [""])[-1] for key in OPTIONS))
    if re.fullmatch(r"[a-z0-9][a-z0-9.-]{1,61}[a-z0-9]", found.bucket) is None:
        raise ConfigError(f"--objects names no bucket: {found.bucket!r}\n{FORMS}")
    endpoint = urlsplit(found.endpoint)
    if found.endpoint and (endpoint.scheme not in ("http", "https") or not endpoint.hostname or endpoint.username):
        raise ConfigError(
            "--objects takes endpoint=http(s)://host:port, and no secret in it: those are in AWS_ACCESS_KEY_ID and"
            " AWS_SECRET_ACCESS_KEY, or in ~/.aws"
        )
    return found
