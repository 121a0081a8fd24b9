"""What the chart renders runs: its command lines as processes, on a real PostgreSQL, S3 and Zenoh, and its probes."""

from __future__ import annotations

import json
import os
import re
import subprocess
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from gateway.domain.host_names import outward_address
from tests.support.deployment.chart_pods import PodHere, asked, probed, walls
from tests.support.deployment.helm import Rendered, parsed, settings_file, template
from tests.support.ports import free_port
from tests.support.servers.postgres import PostgresServer
from tests.support.servers.seaweed import ACCESS_KEY, BUCKET, SECRET_KEY, SeaweedServer
from tests.support.waiting import wait_until

Secrets = dict[str, dict[str, bytes]]
PORTS = ("http", "robots", "programs")


def with_free_ports(name: str, *options: str) -> Rendered:
    """A set of values with ports that are free here."""
    ports = [part for port in PORTS for part in ("--set", f"gateway.ports.{port}={free_port()}")]
    return parsed(template("-f", settings_file(name), *ports, *options))


def pod_of(found: Rendered, component: str) -> dict[str, Any]:
    """The one pod of a component."""
    (pod,) = [pod for _, pod in found.pods() if pod["metadata"]["labels"]["app.kubernetes.io/component"] == component]
    return pod


def tried(found: Rendered, folder: Path) -> subprocess.CompletedProcess[str]:
    """`helm test`, which finds the gateway at this machine instead of at the service's name."""
    pod = pod_of(found, "test")
    container = {**pod["spec"]["containers"][0]}
    container["args"] = ["localhost" if text.endswith(".svc") else text for text in container["args"]]
    return PodHere(pod, folder, secrets={}).run(container)


def await_ready(process: subprocess.Popen[str], container: Mapping[str, Any]) -> None:
    """As the kubelet does: first it has to live, then to be ready."""
    for kind in ("startup", "liveness", "readiness"):
        wait_until(lambda kind=kind: process.poll() is not None or probed(container, kind) == 200)  # type: ignore[misc]
        assert process.poll() is None, process.communicate()[0]


@pytest.fixture
def secrets(postgres: PostgresServer) -> Secrets:
    """Those that the set existing-secrets names and a gateway cannot start without."""
    return {
        "db": {"dsn": postgres.schema().encode()},
        "s3": {"id": ACCESS_KEY.encode(), "secret": SECRET_KEY.encode()},
        "master": {"fleet.key": os.urandom(32)},
    }


@pytest.fixture
def cluster(seaweed: SeaweedServer) -> Rendered:
    """The set existing-secrets on this machine's S3 and on one router, with no secrets but those."""
    none = ("tls", "gateway.oidc", "gateway.notify", "gateway.issuer")
    router = f"tcp/127.0.0.1:{free_port()}"
    options = [f"{name}.existingSecret=" for name in none]
    options += [f"objects.url=s3://{BUCKET}/chart?endpoint={seaweed.endpoint}", f"zenoh.endpoints={{{router}}}"]
    options += ["functions.runners.enabled=true", "gateway.drain.noticeSeconds=1"]
    return with_free_ports("existing-secrets", *(part for option in options for part in ("--set", option)))


def test_a_gateway_of_a_cluster_starts_is_ready_and_drains(cluster: Rendered, secrets: Secrets, tmp_path: Path) -> None:
    job, pod = pod_of(cluster, "migrate"), pod_of(cluster, "gateway")
    (migrate,) = job["spec"]["containers"]
    for _ in range(2):  # an upgrade runs it again
        done = PodHere(job, tmp_path / "migrate", secrets=secrets).run(migrate)
        assert done.returncode == 0, done.stderr
    (container,) = pod["spec"]["containers"]
    assert "--no-functions" in container["args"]
    with ExitStack() as stack:
        endpoint = container["args"][container["args"].index("--cluster") + 1]
        stack.enter_context(router_of_the_chart(endpoint, tmp_path / "router"))
        here = PodHere(pod, tmp_path / "gateway", secrets=secrets)
        process = stack.enter_context(here.start(container))
        await_ready(process, container)
        if walls():  # it runs with a root that it cannot write, as in its pod
            root = next(line for line in mounts_of(process) if line.split()[4] == "/")
            assert "ro" in root.split()[5].split(",")
        (http,) = (port["containerPort"] for port in container["ports"] if port["name"] == "http")
        at = outward_address() or "127.0.0.1"
        assert asked("https", at, http, "/readyz", {"Host": f"{at}:{http}"}) == 200  # by the pod's address
        assert asked("https", "127.0.0.1", http, "/metrics", {"Host": f"{at}:{http}"}) == 401
        assert asked("https", "127.0.0.1", http, "/readyz", {"Host": "fleet-metaros.robots.svc"}) == 200
        assert asked("https", "127.0.0.1", http, "/readyz", {"Host": "else.example"}) == 403
        done = tried(cluster, tmp_path / "test")
        assert (done.returncode, "grpc SERVING" in done.stdout) == (0, True), done.stderr
        assert sign_in_link(here, container).startswith("https://fleet.example/signin#")
        process.terminate()  # what the kubelet does after preStop
        wait_until(lambda: probed(container, "readiness") == 503)
        assert probed(container, "liveness") == 200
        out, _ = process.communicate(timeout=pod["spec"]["terminationGracePeriodSeconds"])
        assert process.returncode == 0, out


def mounts_of(process: subprocess.Popen[str]) -> list[str]:
    """Where a process may write, as Linux has it: proc(5), mountinfo."""
    return Path(f"/proc/{process.pid}/mountinfo").read_text().splitlines()


def router_of_the_chart(endpoint: str, folder: Path) -> Any:
    """The router of the StatefulSet, on the port where that gateway looks for it."""
    port = endpoint.rpartition(":")[2]
    found = parsed(template("-f", settings_file("ha"), "--set", f"zenoh.port={port}"))
    pod = pod_of(found, "zenoh")
    (container,) = pod["spec"]["containers"]
    assert container["ports"] == [{"name": "zenoh", "containerPort": int(port), "protocol": "TCP"}]
    (folder / "data").mkdir(parents=True)  # it has none
    return PodHere(pod, folder, secrets={}).start(container)


def sign_in_link(here: PodHere, container: Mapping[str, Any]) -> str:
    """What NOTES.txt says: `kubectl exec … metaros signin`, with the container's environment."""
    folder = container["args"][container["args"].index("--data-dir") + 1]
    asking = {**container, "args": ["signin", "--data-dir", folder, "--url", "https://fleet.example"]}
    done = here.run(asking)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.integration
def test_one_gateway_alone_makes_its_admin_and_starts(tmp_path: Path) -> None:
    found = with_free_ports("default", "--set", "gateway.drain.noticeSeconds=0", "--set", "gateway.drain.seconds=1")
    pod = pod_of(found, "gateway")
    here = PodHere(pod, tmp_path, secrets={})
    (migrate,), (container,) = pod["spec"]["initContainers"], pod["spec"]["containers"]
    with here.start(container) as process:  # without it nobody could sign in
        out, _ = process.communicate(timeout=120)
        assert (process.returncode, "nobody can sign in yet" in out) == (2, True), out
    done = here.run(migrate)
    assert done.returncode == 0, done.stderr
    assert re.search(r"made admin, an administrator", done.stdout)
    with here.start(container) as process:
        await_ready(process, container)
        assert tried(found, tmp_path / "test").returncode == 0
        assert called(here, container, tmp_path) == {"wrote": 1}
        process.terminate()
        out, _ = process.communicate(timeout=60)
        assert process.returncode == 0, out


def called(here: PodHere, container: Mapping[str, Any], folder: Path) -> Any:
    """What a function answers that needs a temporary file; put in by the command line of the gateway's own user."""
    code = folder / "tmp" / "hello"
    code.mkdir()
    (code / "handler.py").write_text(
        "import tempfile\ndef handler(event, context):\n"
        "    with tempfile.TemporaryFile() as file:\n        return {'wrote': file.write(b'x')}\n"
    )
    for words in (("deploy", "/tmp/hello", "--name", "hello"), ("invoke", "hello")):
        done = here.run({**container, "args": ["function", *words]})
        assert done.returncode == 0, done.stdout + done.stderr
    return json.loads(done.stdout)


@pytest.mark.integration
def test_behind_a_proxy_the_probes_get_in_and_nobody_else(tmp_path: Path) -> None:
    found = with_free_ports("proxy", "--set", "gateway.drain.noticeSeconds=0", "--set", "gateway.drain.seconds=1")
    pod = pod_of(found, "gateway")
    here = PodHere(pod, tmp_path, secrets={})
    (migrate,), (container,) = pod["spec"]["initContainers"], pod["spec"]["containers"]
    assert here.run(migrate).returncode == 0
    with here.start(container) as process:
        await_ready(process, container)
        (http,) = (port["containerPort"] for port in container["ports"] if port["name"] == "http")
        assert asked("http", "127.0.0.1", http, "/api/v1/robots", {"Host": "fleet.example.org"}) == 403
        assert tried(found, tmp_path / "test").returncode == 0
