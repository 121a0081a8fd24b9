"""Objects in a bucket of S3, or of any server that speaks it.

Every request has bounded time and a few attempts, in which boto3 retries what is worth it. The bytes of every upload
carry their SHA-256, which the server checks; what is larger than a part goes up in parts and appears when the last of
them is there. Credentials come as AWS's own tools find them.
"""

from __future__ import annotations

import base64
import contextlib
import hashlib
import logging
from collections.abc import Iterator
from typing import TYPE_CHECKING, BinaryIO

import boto3
from botocore.config import Config
from botocore.exceptions import (
    BotoCoreError,
    ClientError,
    CredentialRetrievalError,
    IncompleteReadError,
    NoCredentialsError,
    PartialCredentialsError,
    ReadTimeoutError,
    ResponseStreamingError,
)
from urllib3.exceptions import HTTPError

from gateway.errors import ObjectMissingError, ObjectRefusedError, ObjectStoreError
from gateway.store.objects.store import ObjectInfo, Source, check_name, opened, pieces

if TYPE_CHECKING:
    from types_boto3_s3 import S3Client
    from types_boto3_s3.type_defs import CompletedPartTypeDef

    from gateway.store.objects.urls import BucketUrl

__all__ = ["PART_BYTES", "S3Store"]

log = logging.getLogger(__name__)

PART_BYTES = 8 << 20
PARTS = 10_000  # S3's own bound
CONNECT_S, READ_S, ATTEMPTS = 5.0, 20.0, 3
READ_ATTEMPTS = 3  # a download that breaks off half way, which boto3 does not begin again
DEFAULT_REGION = "us-east-1"

_REFUSED = frozenset(
    (
        "AccessDenied",
        "AllAccessDisabled",
        "AuthorizationHeaderMalformed",
        "ExpiredToken",
        "InvalidAccessKeyId",
        "InvalidBucketName",
        "InvalidToken",
        "NoSuchBucket",
        "PermanentRedirect",
        "SignatureDoesNotMatch",
        "301",
        "401",
        "403",
    )
)
_MISSING = frozenset(("NoSuchKey", "404"))
_BROKEN_OFF = (IncompleteReadError, ReadTimeoutError, ResponseStreamingError, HTTPError)


class S3Store:
    """One bucket, below one prefix; used by several threads at once."""

    def __init__(self, url: BucketUrl) -> None:
        self._url = url
        self._prefix = f"{url.prefix}/" if url.prefix else ""
        self._client = _client(url)

    @property
    def where(self) -> str:
        """The bucket and its server."""
        return self._url.where

    def put(self, name: str, source: Source, *, size_bytes: int, sha256: str) -> None:
        """Keep the rest of `source` under `name`, in parts when it is large."""
        key = self._key(name)
        with _errors(name, self.where):
            try:
                with opened(source) as file:
                    if size_bytes <= PART_BYTES:
                        (body,) = pieces(file, size_bytes=size_bytes, sha256=sha256, piece_bytes=PART_BYTES)
                        self._client.put_object(
                            Bucket=self._url.bucket, Key=key, Body=body, ChecksumSHA256=_checksum(body)
                        )
                    else:
                        self._put_parts(key, file, size_bytes, sha256)
            except OSError as error:  # of the file: boto3's have roots of their own
                raise ObjectStoreError(f"{name}: {error}") from error

    def read(self, name: str, *, start: int = 0, size_bytes: int | None = None) -> bytes:
        """That range of the object, or what there is of it."""
        key = self._key(name)
        if size_bytes == 0:
            return b""
        asked = f"bytes={start}-" + ("" if size_bytes is None else str(start + size_bytes - 1))
        with _errors(name, self.where):
            for _ in range(READ_ATTEMPTS - 1):
                with contextlib.suppress(*_BROKEN_OFF):
                    return self._get(key, asked)
            return self._get(key, asked)

    def names(self, prefix: str = "") -> Iterator[ObjectInfo]:
        """Every object whose name begins with `prefix`."""
        pages = self._client.get_paginator("list_objects_v2")
        with _errors(prefix, self.where):
            for page in pages.paginate(Bucket=self._url.bucket, Prefix=self._prefix + prefix):
                for item in page.get("Contents", ()):
                    modified_ns = round(item["LastModified"].timestamp() * 1e9)
                    yield ObjectInfo(item["Key"][len(self._prefix) :], item["Size"], modified_ns)

    def delete(self, name: str) -> None:
        """The object is gone, whether it was there or not."""
        with _errors(name, self.where):
            self._client.delete_object(Bucket=self._url.bucket, Key=self._key(name))

    def sweep(self, *, before_ns: int) -> int:
        """Abort the uploads in parts that began before and never ended: they cost space that no listing shows."""
        aborted = 0
        pages = self._client.get_paginator("list_multipart_uploads")
        with _errors("uploads", self.where):
            for page in pages.paginate(Bucket=self._url.bucket, Prefix=self._prefix):
                for upload in page.get("Uploads", ()):
                    if upload["Initiated"].timestamp() * 1e9 < before_ns:
                        self._abort(upload["Key"], upload["UploadId"])
                        aborted += 1
        return aborted

    def close(self) -> None:
        """Close the connections."""
        self._client.close()

    def _key(self, name: str) -> str:
        return self._prefix + check_name(name)

    def _get(self, key: str, asked: str) -> bytes:
        try:
            return self._client.get_object(Bucket=self._url.bucket, Key=key, Range=asked)["Body"].read()
        except ClientError as error:
            if _code(error) == "InvalidRange":
                return b""
            raise

    def _put_parts(self, key: str, file: BinaryIO, size_bytes: int, sha256: str) -> None:
        """Only whole and checked uploads are completed; any other is aborted, now or by a later sweep."""
        bucket = self._url.bucket
        upload = self._client.create_multipart_upload(Bucket=bucket, Key=key, ChecksumAlgorithm="SHA256")["UploadId"]
        part_bytes = max(PART_BYTES, -(-size_bytes // PARTS))
        parts: list[CompletedPartTypeDef] = []
        try:
            for body in pieces(file, size_bytes=size_bytes, sha256=sha256, piece_bytes=part_bytes):
                number, checksum = len(parts) + 1, _checksum(body)
                answer = self._client.upload_part(
                    Bucket=bucket, Key=key, UploadId=upload, PartNumber=number, Body=body, ChecksumSHA256=checksum
                )
                parts.append({"PartNumber": number, "ETag": answer["ETag"], "ChecksumSHA256": checksum})
            self._client.complete_multipart_upload(
                Bucket=bucket, Key=key, UploadId=upload, MultipartUpload={"Parts": parts}
            )
        except BaseException:
            try:
                self._abort(key, upload)
            except (BotoCoreError, ClientError, HTTPError) as error:
                log.warning("an upload to %s could not be aborted and is swept later: %s", self.where, error)
            raise

    def _abort(self, key: str, upload: str) -> None:
        try:
            self._client.abort_multipart_upload(Bucket=self._url.bucket, Key=key, UploadId=upload)
        except ClientError as error:
            if _code(error) not in ("NoSuchUpload", "404"):
                raise


def _client(url: BucketUrl) -> S3Client:
    """A client of its own session; boto3 itself asks for no checksums beyond ours."""
    config = Config(
        connect_timeout=CONNECT_S,
        read_timeout=READ_S,
        retries={"total_max_attempts": ATTEMPTS, "mode": "standard"},
        request_checksum_calculation="when_required",
        response_checksum_validation="when_required",
        max_pool_connections=8,
        s3={"addressing_style": "path"} if url.endpoint else {},
    )
    try:
        session = boto3.Session()
        return session.client(
            "s3",
            endpoint_url=url.endpoint or None,
            region_name=url.region or session.region_name or DEFAULT_REGION,
            config=config,
        )
    except BotoCoreError as error:
        raise ObjectRefusedError(f"{url.where}: {error}") from error


def _checksum(body: bytes) -> str:
    return base64.b64encode(hashlib.sha256(body).digest()).decode()


def _code(error: ClientError) -> str:
    return str(error.response.get("Error", {}).get("Code", ""))


@contextlib.contextmanager
def _errors(name: str, where: str) -> Iterator[None]:
    try:
        yield
    except ClientError as error:
        code = _code(error)
        if code in _MISSING:
            raise ObjectMissingError(f"there is no object {name} in {where}") from error
        kind = ObjectRefusedError if code in _REFUSED else ObjectStoreError
        raise kind(f"{where}: {error}") from error
    except (NoCredentialsError, PartialCredentialsError, CredentialRetrievalError) as error:
        raise ObjectRefusedError(f"{where}: {error}") from error
    except (BotoCoreError, HTTPError) as error:
        raise ObjectStoreError(f"{where}: {error}") from error
