"""Where large things are kept under a name: a directory, or an S3 bucket."""

from __future__ import annotations

from gateway.objects.directory import DirectoryStore
from gateway.objects.store import ObjectInfo, ObjectStore, chunks
from gateway.objects.urls import check_objects_url, open_objects

__all__ = ["DirectoryStore", "ObjectInfo", "ObjectStore", "check_objects_url", "chunks", "open_objects"]
