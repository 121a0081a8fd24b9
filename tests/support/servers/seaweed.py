"""A real S3 server for tests: SeaweedFS on loopback with its own data, killed and started as a test likes."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import boto3
import botocore.exceptions
from botocore.config import Config

from tests.support.gateways.quick_boto import read_documents_once
from tests.support.ports import free_port
from tests.support.waiting import wait_until

if TYPE_CHECKING:
    from types_boto3_s3 import S3Client

__all__ = ["ACCESS_KEY", "BUCKET", "SECRET_KEY", "SeaweedServer"]

ACCESS_KEY, SECRET_KEY, BUCKET = "metaros-tests", "a-secret-of-the-tests", "fleet"
read_documents_once()
SWITCHED_OFF = ("-master.telemetry=false", "-s3.port.iceberg=0", "-s3.port.lance=0")
ALONE = ("-master.electionTimeout=300ms",)  # a server that is started again waits for nobody's vote; it would for 10 s


class SeaweedServer:
    """One server; what was stored before `kill` is there after `start`."""

    def __init__(self) -> None:
        self._folder = Path(tempfile.mkdtemp(prefix="mrweed"))
        self._log = (self._folder / "log").open("wb")
        roles = ("master", "volume", "filer", "s3")
        self._ports = {f"{role}.port{kind}": free_port() for role in roles for kind in ("", ".grpc")}
        self.process: subprocess.Popen[bytes] | None = None
        rights = ["Admin", "Read", "Write", "List", "Tagging"]
        keys = [{"accessKey": ACCESS_KEY, "secretKey": SECRET_KEY}]
        identities = {"identities": [{"name": "tests", "credentials": keys, "actions": rights}]}
        (self._folder / "s3.json").write_text(json.dumps(identities))

    @property
    def port(self) -> int:
        """Where S3 is spoken."""
        return self._ports["s3.port"]

    @property
    def endpoint(self) -> str:
        """The same as a URL."""
        return f"http://127.0.0.1:{self.port}"

    def start(self) -> None:
        """Start, and wait until it has stored something."""
        folder = self._folder / "data"
        folder.mkdir(exist_ok=True)
        program = Path(sys.executable).with_name("weed")
        ports = [f"-{name}={port}" for name, port in self._ports.items()]
        sockets = [f"-{name}.localSocket={self._folder / name}" for name in ("filer", "s3")]
        self.process = subprocess.Popen(
            [
                *(program, "-logtostderr=true", "server", *SWITCHED_OFF, "-ip=127.0.0.1", "-ip.bind=127.0.0.1"),
                *("-s3", "-filer", f"-dir={folder}", f"-s3.config={self._folder / 's3.json'}", *ports, *sockets),
                *("-volume.max=40", "-master.volumeSizeLimitMB=64", *ALONE),
            ],
            stdin=subprocess.DEVNULL,
            stdout=self._log,
            stderr=self._log,
            cwd=self._folder,
            start_new_session=True,
        )
        wait_until(self._answers)

    def kill(self) -> None:
        """As a crash."""
        process, self.process = self.process, None
        if process is not None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()

    def close(self) -> None:
        """End it and delete its data."""
        self.kill()
        self._client.close()
        self._log.close()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _answers(self) -> bool:
        assert self.process is not None
        if self.process.poll() is not None:
            raise RuntimeError((self._folder / "log").read_text()[-2000:])
        try:
            socket.create_connection(("127.0.0.1", self.port), timeout=1.0).close()  # S3 is the last that comes
            self._client.put_object(Bucket=BUCKET, Key="it-runs", Body=b"1")  # it makes the bucket
            self._client.delete_object(Bucket=BUCKET, Key="it-runs")
        except (OSError, botocore.exceptions.BotoCoreError, botocore.exceptions.ClientError):
            return False
        return True

    @cached_property
    def _client(self) -> S3Client:
        return boto3.client(
            "s3",
            endpoint_url=self.endpoint,
            region_name="us-east-1",
            aws_access_key_id=ACCESS_KEY,
            aws_secret_access_key=SECRET_KEY,
            config=Config(connect_timeout=2, read_timeout=10, retries={"total_max_attempts": 1}),
        )
