"""Every test that asks for `objects` runs on a directory and on a real S3 server."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from gateway.store.objects import ObjectStore, open_objects
from tests.support.servers.seaweed import ACCESS_KEY, BUCKET, SECRET_KEY, SeaweedServer

STORES = ("directory", pytest.param("s3", marks=pytest.mark.integration))


@pytest.fixture
def s3_url(seaweed: SeaweedServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., str]:
    """URLs of an empty place in the bucket, with the right secret in the environment."""
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", ACCESS_KEY)
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", SECRET_KEY)
    monkeypatch.setenv("AWS_CONFIG_FILE", str(tmp_path / "none"))
    monkeypatch.setenv("AWS_SHARED_CREDENTIALS_FILE", str(tmp_path / "none"))

    def url(*, port: int | None = None, bucket: str = BUCKET) -> str:
        return (
            f"s3://{bucket}/{tmp_path.name.lower().replace('_', '-')}?endpoint=http://127.0.0.1:{port or seaweed.port}"
        )

    return url


@pytest.fixture(params=STORES)
def objects(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[ObjectStore]:
    """An empty object store."""
    url = "" if request.param == "directory" else request.getfixturevalue("s3_url")()
    store = open_objects(url, tmp_path)
    yield store
    store.close()
