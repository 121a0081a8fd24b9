"""Opens the object store that a URL names."""

from __future__ import annotations

from pathlib import Path

from gateway.store.objects.directory import DirectoryStore
from gateway.store.objects.store import ObjectStore
from gateway.store.objects.urls import BucketUrl, parse_objects_url

__all__ = ["open_objects"]

FOLDER = "objects"


def open_objects(url: str, data_dir: Path) -> ObjectStore:
    """The object store at `url`; it is not asked for anything yet.

    Raises:
        ConfigError: the URL names none.
    """
    parsed = parse_objects_url(url)
    if isinstance(parsed, BucketUrl):
        from gateway.store.objects.s3 import S3Store  # heavy, and only needed here

        return S3Store(parsed)
    return DirectoryStore(parsed if parsed is not None else data_dir / FOLDER)
