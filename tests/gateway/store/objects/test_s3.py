"""What can go wrong with S3: cut connections, wrong secrets, a killed server; on a real one."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gateway.errors import ObjectMissingError, ObjectRefusedError, ObjectStoreError
from gateway.store.objects import ObjectStore, open_objects
from tests.support.servers.cutting_proxy import CuttingProxy
from tests.support.servers.seaweed import SeaweedServer

pytestmark = pytest.mark.integration

LARGE = np.random.default_rng(7).bytes((8 << 20) * 3)
SHA = hashlib.sha256(LARGE).hexdigest()
EVER_NS = 1 << 62


def put(objects: ObjectStore, name: str) -> None:
    """Upload three parts."""
    objects.put(name, io.BytesIO(LARGE), size_bytes=len(LARGE), sha256=SHA)


@pytest.mark.parametrize("up", [100, (8 << 20) + 1000, 20 << 20])
def test_an_upload_cut_in_the_middle_leaves_no_object(s3_url: Callable[..., str], up: int, tmp_path: Path) -> None:
    sure = open_objects(s3_url(), tmp_path)
    with CuttingProxy(int(s3_url().rpartition(":")[2])) as proxy:
        objects = open_objects(s3_url(port=proxy.port), tmp_path)
        proxy.cut_after(up=up)
        with pytest.raises(ObjectStoreError):
            put(objects, "a")
        assert proxy.cuts == 1
        assert list(sure.names()) == []
        with pytest.raises(ObjectMissingError):
            sure.read("a")
        proxy.mend()
        put(objects, "a")
        assert hashlib.sha256(objects.read("a")).hexdigest() == SHA
        objects.close()
    assert sure.sweep(before_ns=0) == 0  # an upload that may still go on is left alone
    swept = sure.sweep(before_ns=EVER_NS)
    assert swept == (1 if up > 100 else 0)  # the abort could not get through either
    assert sure.sweep(before_ns=EVER_NS) == 0
    assert [info.name for info in sure.names()] == ["a"]
    sure.close()


def test_one_cut_is_got_over(s3_url: Callable[..., str], tmp_path: Path) -> None:
    with CuttingProxy(int(s3_url().rpartition(":")[2])) as proxy:
        objects = open_objects(s3_url(port=proxy.port), tmp_path)
        proxy.cut_after(up=12 << 20, once=True)
        put(objects, "a")
        proxy.cut_after(down=5 << 20, once=True)
        assert hashlib.sha256(objects.read("a")).hexdigest() == SHA
        assert proxy.cuts == 2
        assert objects.sweep(before_ns=EVER_NS) == 0
        objects.close()


def test_a_wrong_secret_is_refused(s3_url: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    right = open_objects(s3_url(), tmp_path)
    put(right, "a")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "not-the-secret")
    wrong = open_objects(s3_url(), tmp_path)
    for work in (
        lambda: put(wrong, "b"),
        lambda: wrong.put("c", io.BytesIO(b"x"), size_bytes=1, sha256=hashlib.sha256(b"x").hexdigest()),
        lambda: wrong.read("a"),
        lambda: list(wrong.names()),
        lambda: wrong.delete("a"),
        lambda: wrong.sweep(before_ns=EVER_NS),
    ):
        with pytest.raises(ObjectRefusedError) as refused:
            work()
        assert "not-the-secret" not in str(refused.value)
    assert [info.name for info in right.names()] == ["a"]
    right.close()
    wrong.close()


def test_no_credentials_and_no_bucket(
    s3_url: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    nowhere = open_objects(s3_url(bucket="no-such-bucket"), tmp_path)
    with pytest.raises(ObjectRefusedError, match="NoSuchBucket"):
        nowhere.read("a")
    nowhere.close()
    monkeypatch.delenv("AWS_ACCESS_KEY_ID")
    monkeypatch.setenv("AWS_EC2_METADATA_DISABLED", "true")
    nobody = open_objects(s3_url(), tmp_path)
    with pytest.raises(ObjectRefusedError, match="credentials"):
        nobody.read("a")
    nobody.close()


def test_a_killed_server_comes_back_with_everything(
    seaweed: SeaweedServer, s3_url: Callable[..., str], tmp_path: Path
) -> None:
    objects = open_objects(s3_url(), tmp_path)
    put(objects, "a")
    seaweed.kill()
    try:
        with pytest.raises(ObjectStoreError):
            put(objects, "b")
        with pytest.raises(ObjectStoreError):
            objects.read("a")
    finally:
        seaweed.start()
    assert hashlib.sha256(objects.read("a")).hexdigest() == SHA
    put(objects, "b")
    assert [info.name for info in objects.names()] == ["a", "b"]
    objects.close()
