"""Object stores: a directory, or an S3 bucket."""

from __future__ import annotations

from gateway.store.objects.directory import DirectoryStore
from gateway.store.objects.factory import open_objects
from gateway.store.objects.store import ObjectInfo, ObjectStore, chunks
from gateway.store.objects.urls import check_objects_url

__all__ = ["DirectoryStore", "ObjectInfo", "ObjectStore", "check_objects_url", "chunks", "open_objects"]
