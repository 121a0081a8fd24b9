"""A pod of the chart as processes of this machine: its own arguments, environment and probes, without a cluster.

What only the kubelet gives is put in its place: files of secrets, values of secrets in the environment, and a folder
for each mounted volume. Where this machine allows it, they see all but the pod's own volumes read-only, as there.
"""

from __future__ import annotations

import contextlib
import functools
import http.client
import os
import shutil
import ssl
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from tests.support.processes.command_line import call_metaros
from tests.support.processes.processes import started

__all__ = ["PodHere", "asked", "probed", "walls"]

Object = Mapping[str, Any]
READ_ONLY = (
    "mount --make-rprivate / && mount --bind {data} {data} && mount --bind {tmp} {tmp}"
    ' && mount -o remount,bind,ro / && exec "$@"'
)


@functools.cache
def walls() -> bool:
    """Whether a process may have mounts of its own here."""
    if sys.platform != "linux" or os.getuid() != 0 or shutil.which("unshare") is None:
        return False
    return subprocess.run(["unshare", "-m", "mount", "--make-rprivate", "/"], capture_output=True).returncode == 0


class PodHere:
    """`secrets` are by name of the secret and key."""

    def __init__(self, pod: Object, folder: Path, *, secrets: Mapping[str, Mapping[str, bytes]]) -> None:
        self._spec = pod["spec"]
        self._folder = folder
        self._secrets = secrets
        for volume in self._spec["volumes"]:
            place = folder / volume["name"]
            place.mkdir(parents=True, exist_ok=True)
            for key, content in self._of(volume).items():
                (place / key).write_bytes(content)
                (place / key).chmod(0o400)

    def environ(self, container: Object) -> dict[str, str]:
        """What the container has, and the way to this Python's programs.

        Also a place for what runs in the pod: where it would be, in the temporary folder, Python looks only once.
        """
        found = {"PATH": os.environ["PATH"], "METAROS_RUNTIME_DIR": str(self._folder / "tmp" / "run")}
        for item in container.get("env", ()):
            value = item.get("value")
            if value is None:
                asked = item["valueFrom"]["secretKeyRef"]
                value = self._secrets[asked["name"]][asked["key"]].decode()
            found[item["name"]] = self._placed(container, value)
        return found

    def command(self, container: Object) -> list[str]:
        """Its arguments behind the image's entry point, or its own command."""
        arguments = [self._placed(container, text) for text in container["args"]]
        if "command" in container:
            return [sys.executable, *container["command"][1:], *arguments]
        return [sys.executable, "-m", "metaros", *arguments]

    def walled(self, container: Object) -> list[str]:
        """The same, where only the volumes `data` and `tmp` can be written."""
        if not walls() or not container["securityContext"]["readOnlyRootFilesystem"]:
            return self.command(container)
        mounts = READ_ONLY.format(data=self._folder / "data", tmp=self._folder / "tmp")
        return ["unshare", "-m", "sh", "-c", mounts, "sh", *self.command(container)]

    def run(self, container: Object) -> subprocess.CompletedProcess[str]:
        """To its end; where it is `metaros`, in this process, with nothing but the container's environment."""
        environ = self.environ(container)
        if "command" not in container:
            with _environment(environ):
                done = call_metaros(*self.command(container)[3:])
            return subprocess.CompletedProcess(container["args"], done.code, done.out, done.err)
        return subprocess.run(self.command(container), capture_output=True, text=True, env=environ, timeout=120)

    def start(self, container: Object) -> AbstractContextManager[subprocess.Popen[str]]:
        """In the background."""
        return started(self.walled(container), env=self.environ(container), stderr=subprocess.STDOUT)

    def _of(self, volume: Object) -> Mapping[str, bytes]:
        return self._secrets[volume["secret"]["secretName"]] if "secret" in volume else {}

    def _placed(self, container: Object, text: str) -> str:
        """Paths of the container as they are here; "/tmp" alone is one, too."""
        for mount in sorted(container["volumeMounts"], key=lambda mount: -len(mount["mountPath"])):
            path = mount["mountPath"]
            if text == path or text.startswith(f"{path}/"):
                return str(self._folder / mount["name"]) + text.removeprefix(path)
        return text


@contextlib.contextmanager
def _environment(environ: Mapping[str, str]) -> Iterator[None]:
    """In the place of this process's own."""
    before = dict(os.environ)
    try:
        os.environ.clear()
        os.environ.update(environ)
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


def probed(container: Object, kind: str, *, host: str = "127.0.0.1") -> int:
    """What the kubelet's HTTP probe would see: a status, or 0 where nobody answers. It verifies no certificate."""
    probe = container[f"{kind}Probe"]["httpGet"]
    (port,) = (port["containerPort"] for port in container["ports"] if port["name"] == probe["port"])
    headers = {item["name"]: item["value"] for item in probe.get("httpHeaders", ())}
    return asked(probe["scheme"].lower(), host, port, probe["path"], headers)


def asked(scheme: str, host: str, port: int, path: str, headers: Mapping[str, str]) -> int:
    """The status of a GET; 0 where nobody answers."""
    connection: http.client.HTTPConnection
    if scheme == "https":
        anybody = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)  # the default one reads the machine's roots, in vain
        anybody.check_hostname, anybody.verify_mode = False, ssl.CERT_NONE
        connection = http.client.HTTPSConnection(host, port, timeout=10, context=anybody)
    else:
        connection = http.client.HTTPConnection(host, port, timeout=10)
    try:
        connection.request("GET", path, headers=dict(headers))
        return connection.getresponse().status
    except OSError:
        return 0
    finally:
        connection.close()
