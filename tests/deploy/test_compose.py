"""The one-host deployment: its options, names, secrets and ports are those of the programs, and its lines run.

Docker is not here: the file is read, and the command lines of its gateways run before the nginx of its configuration.
"""

from __future__ import annotations

import contextlib
import functools
import http.client
import ipaddress
import json
import os
import re
import ssl
import subprocess
import sys
import urllib.request
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.support.deployment.deployed import options_of, settings_of
from tests.support.ports import free_port
from tests.support.processes.command_line import run_metaros
from tests.support.processes.processes import end
from tests.support.processes.stack import Stack
from tests.support.servers.certificates import make_certificate
from tests.support.servers.nginx import nginx_program
from tests.support.servers.postgres import PostgresServer
from tests.support.waiting import wait_until

ROOT = Path(__file__).resolve().parents[2]
DEPLOY = ROOT / "deploy"
GATEWAYS = ("gateway-1", "gateway-2")
OURS = (*GATEWAYS, "router", "migrate")
VARIABLE = re.compile(r"\$\{(\w+)(?::(-|\?)([^}]*))?\}")


def compose(**environ: str) -> dict[str, Any]:
    """The file as docker would read it: merged, and with the variables put in."""

    def value(match: re.Match[str]) -> str:
        name, kind, other = match.groups()
        assert name in environ or kind == "-", f"{name} is needed"
        return environ.get(name, other)

    return dict(yaml.safe_load(VARIABLE.sub(value, (DEPLOY / "compose.yaml").read_text())))


@pytest.fixture
def services() -> dict[str, dict[str, Any]]:
    """Its services, with what somebody must say."""
    return dict(compose(METAROS_HOST="fleet.example")["services"])


def seconds(text: str) -> float:
    """ "60s" as a number."""
    return float(text.removesuffix("s"))


def addresses(service: dict[str, Any]) -> str:
    """Its fixed address in the front network."""
    return str(service["networks"]["front"]["ipv4_address"])


def test_every_command_is_one_of_ours(services: dict[str, dict[str, Any]]) -> None:
    assert [options_of(services[name]["command"])[0] for name in OURS] == [
        "gateway",
        "gateway",
        "router",
        "gateway store migrate",
    ]


def test_the_gateways_settings_hold_together(services: dict[str, dict[str, Any]]) -> None:
    for name in GATEWAYS:
        service = services[name]
        made = settings_of(service["command"], store_url=service["environment"]["METAROS_STORE"])
        assert made.proxied_only
        assert made.enrolled_only
        assert not made.functions
        assert made.trusted_proxies == (addresses(services["nginx"]),)
        assert made.allow_hosts == ("fleet.example",)
        assert made.cluster == ("tcp/router:7447",)
        assert seconds(service["stop_grace_period"]) > made.drain_notice_s + 2 * made.drain_s + 25
        mounted = [volume.split(":")[1] for volume in service["volumes"]]
        assert any(str(made.data_dir).startswith(folder) for folder in mounted)
        assert made.objects_url.removeprefix("file://") in mounted


def test_functions_can_be_had_in_a_sandbox() -> None:
    gateway = compose(METAROS_HOST="fleet.example", METAROS_FUNCTIONS="--sandbox-require=L2")["services"]["gateway-1"]
    made = settings_of(gateway["command"], store_url="postgresql://a@b/c")
    assert (made.functions, made.sandbox_require) == (True, "L2")


def test_two_gateways_share_what_they_must_and_nothing_else(services: dict[str, dict[str, Any]]) -> None:
    first, second = (services[name] for name in GATEWAYS)
    assert first["command"] == second["command"]
    assert first["environment"] == second["environment"]
    assert {"objects:/var/lib/metaros-objects"} == set(first["volumes"]) & set(second["volumes"])


def test_variables_are_known_to_the_programs(services: dict[str, dict[str, Any]]) -> None:
    from tests.layout.test_docs import command_tree

    known = {getattr(option, "envvar", None) for _, command in command_tree() for option in command.params}
    ours = {name for service in OURS for name in services[service].get("environment", {})}
    assert {name for name in ours if name.startswith("METAROS_")} <= known
    asked = {match[1] for match in VARIABLE.finditer((DEPLOY / "compose.yaml").read_text())}
    example = set(re.findall(r"^#? ?(METAROS_\w+)=", (DEPLOY / "env.example").read_text(), re.MULTILINE))
    assert asked == example
    page = (ROOT / "docs" / "howto" / "one_host.md").read_text()
    assert [name for name in asked if name not in page] == []


def test_secrets_are_files_that_are_there_for_who_uses_them(services: dict[str, dict[str, Any]]) -> None:
    declared = compose(METAROS_HOST="x.example")["secrets"]
    used = {name for service in services.values() for name in service.get("secrets", [])}
    assert used == set(declared)
    texts = {name: json.dumps(service) for name, service in services.items()}
    texts["nginx"] += (DEPLOY / "nginx.conf").read_text()
    for name, text in texts.items():
        assert set(re.findall(r"/run/secrets/(\w+)", text)) == set(services[name].get("secrets", [])), name
    page = (ROOT / "docs" / "howto" / "one_host.md").read_text()
    assert [name for name, entry in declared.items() if entry["file"].removeprefix("./") not in page] == []
    assert services["postgres"]["environment"]["POSTGRES_PASSWORD_FILE"] == "/run/secrets/postgres_password"
    assert re.findall(r"(?i)\w*(?:password|secret|key)\"?: ?\"[^/.]|://\w+:\w+@", json.dumps(services)) == []


def test_one_port_is_published_and_the_inner_network_has_no_way_out(services: dict[str, dict[str, Any]]) -> None:
    assert {name: service["ports"] for name, service in services.items() if "ports" in service} == {
        "nginx": ["443:8443"]
    }
    networks = compose(METAROS_HOST="x.example")["networks"]
    assert networks["back"]["internal"] is True
    assert services["postgres"]["networks"] == services["router"]["networks"] == ["back"]
    (pool,) = networks["front"]["ipam"]["config"]
    hosts = [addresses(services[name]) for name in ("nginx", *GATEWAYS)]
    assert all(ipaddress.ip_address(host) in ipaddress.ip_network(pool["subnet"]) for host in hosts)


def test_nobody_is_root_and_everything_has_a_bound(services: dict[str, dict[str, Any]]) -> None:
    for name, service in services.items():
        assert "mem_limit" in service, name
        assert service["restart"].split(":")[0] in ("unless-stopped", "on-failure"), name
        assert "no-new-privileges:true" in service["security_opt"], name
        assert "healthcheck" in service, name
        if name != "postgres":  # which has to give its folder to its own user
            assert service["cap_drop"] == ["ALL"], name
            assert service["read_only"] is True, name
            assert "privileged" not in service, name


def test_health_is_asked_where_it_is_answered(services: dict[str, dict[str, Any]]) -> None:
    from gateway.api import route_paths

    asked = set(re.findall(r"/(?:healthz|readyz)\b", json.dumps(services) + (DEPLOY / "healthcheck.py").read_text()))
    assert asked == {"/healthz", "/readyz"}
    assert asked <= set(route_paths())
    assert services["gateway-1"]["healthcheck"]["test"] == ["CMD", "python", "/opt/metaros/healthcheck.py", "8080"]
    assert "7447" in json.dumps(services["router"]["healthcheck"])
    assert "--port=7447" in services["router"]["command"]
    waits = {other for service in services.values() for other in service.get("depends_on", {})}
    assert all("healthcheck" in services[other] for other in waits)


def test_nginx_knows_the_gateways(services: dict[str, dict[str, Any]]) -> None:
    text = (DEPLOY / "nginx.conf").read_text()
    assert re.findall(r"server ([\d.:]+)", text) == [f"{addresses(services[name])}:8080" for name in GATEWAYS]
    (published,) = services["nginx"]["ports"]
    assert f"listen {published.split(':')[1]} ssl;" in text


class OneHost(Stack):
    """The file's gateways on this machine, on ports of the test, behind the file's nginx."""

    def prepare(self, postgres: PostgresServer) -> None:
        """Paths, ports and secrets of the test in the place of the file's."""
        self.store = postgres.schema()
        self.ports = {name: free_port() for name in GATEWAYS}
        self.https = free_port()
        (self.folder / "secrets").mkdir()
        (self.folder / "secrets" / "master_key").write_bytes(os.urandom(32))
        (self.folder / "secrets" / "master_key").chmod(0o400)
        self.certificate = make_certificate(self.folder)
        self.nginx: subprocess.Popen[bytes] | None = None

    def words(self, service: str) -> list[str]:
        """The command of a service."""
        command = compose(METAROS_HOST="localhost")["services"][service]["command"]
        swaps = {
            "/run/secrets": str(self.folder / "secrets"),
            "/var/lib/metaros-objects": str(self.folder / "objects"),
            "/var/lib/metaros/": f"{self.folder / service}/",
            "/tmp/migrate": str(self.folder / "migrate"),
            "=172.30.80.10": "=127.0.0.1",
            "tcp/router:7447": f"tcp/127.0.0.1:{self.zenoh_port}",
            "--port=7447": f"--port={self.zenoh_port}",
        }
        for there, here in swaps.items():
            command = [word.replace(there, here) for word in command]
        return command

    def run_once(self, *words: str) -> str:
        """A command that ends, with the store and the key of the file's environment."""
        return run_metaros(*words)

    def up(self) -> None:
        """As docker compose orders it: router, migrate, gateways, nginx."""
        self.start("router", *self.words("router"))
        self.run_once(*self.words("migrate"))
        free = ["--grpc-port=0", "--api-grpc-port=0", "--foxglove-port=off", "--rosbridge-port=off"]
        commands = {name: [*self.words(name), f"--port={self.ports[name]}", *free] for name in GATEWAYS}
        self.at_once(*(functools.partial(self.start, name, *words) for name, words in commands.items()))
        text = (DEPLOY / "nginx.conf").read_text()
        swaps = {
            "/tmp/": f"{self.folder}/",
            "worker_processes auto": "worker_processes 1",  # each knows by itself which gateways do not answer
            "/run/secrets/tls_certificate": str(self.certificate),
            "/run/secrets/tls_key": str(self.certificate.with_suffix(".key")),
            "listen 8443": f"listen 127.0.0.1:{self.https}",
            "172.30.80.11:8080": f"127.0.0.1:{self.ports['gateway-1']}",
            "172.30.80.12:8080": f"127.0.0.1:{self.ports['gateway-2']}",
        }
        for there, here in swaps.items():
            assert there in text, there
            text = text.replace(there, here)
        if os.geteuid() == 0:
            text = "user root;\n" + text
        (self.folder / "nginx.conf").write_text(text)
        with (self.folder / "nginx.log").open("ab") as log:
            command = [nginx_program(), "-p", self.folder, "-e", "nginx.error", "-c", "nginx.conf", "-g", "daemon off;"]
            self.nginx = subprocess.Popen(command, stdout=log, stderr=log, stdin=subprocess.DEVNULL)
        wait_until(lambda: self.https_get("/healthz") == 200 or self._gone(), timeout_s=60)
        assert not self._gone(), (self.folder / "nginx.log").read_text()

    def https_get(self, path: str, **headers: str) -> int:
        """The status by nginx; 0 while nobody answers."""
        trust = ssl.create_default_context(cafile=str(self.certificate))
        request = urllib.request.Request(f"https://localhost:{self.https}{path}", headers=headers)
        try:
            with urllib.request.urlopen(request, context=trust, timeout=30) as answer:
                return int(answer.status)
        except urllib.error.HTTPError as error:
            return error.code
        except OSError:
            return 0

    def direct_get(self, path: str, service: str) -> int:
        """The status for somebody who is not nginx."""
        port = self.ports[service]
        connection = http.client.HTTPConnection("127.0.0.1", port, source_address=("127.0.0.9", 0), timeout=30)
        connection.request("GET", path, headers={"Host": "localhost"})
        status = connection.getresponse().status
        connection.close()
        return status

    def enrol(self, name: str) -> None:
        """A robot with a router of its own comes by nginx, as the how-to says."""
        url = f"https://localhost:{self.https}"
        token = json.loads(self.run_once("robot", "token", "--robot", name, "--gateway", url, "-o", "json"))["token"]
        state = ("--name", name, "--state-dir", str(self.folder / name))
        self.run_once("agent", "enrol", token, "--gateway", url, *state)
        port = str(free_port())
        self.start("robots-router", "router", "--port", port)
        self.start("agent", "agent", *state, "--zenoh-port", port)

    def sees(self, robot: str) -> list[str]:
        """Which gateways call the robot online, asked as nginx asks them."""
        found = []
        for name, port in self.ports.items():
            headers = {"Authorization": f"Bearer {os.environ['METAROS_KEY']}", "Host": "localhost"}
            request = urllib.request.Request(f"http://127.0.0.1:{port}/api/v1/robots/{robot}", headers=headers)
            with contextlib.suppress(OSError), urllib.request.urlopen(request, timeout=30) as answer:
                found += [name] if json.load(answer)["state"] == "online" else []
        return found

    def takes(self) -> str:
        """Which gateway nginx asks now."""
        before = self._answered()
        assert self.https_get("/healthz") == 200
        after = self._answered()
        (name,) = (name for name in GATEWAYS if after[name] > before[name])
        return name

    def _answered(self) -> dict[str, float]:
        """How often each gateway that runs was asked whether it lives."""
        found = dict.fromkeys(GATEWAYS, 0.0)
        for name, port in self.ports.items():
            headers = {"Authorization": f"Bearer {os.environ['METAROS_KEY']}", "Host": "localhost"}
            request = urllib.request.Request(f"http://127.0.0.1:{port}/metrics", headers=headers)
            with urllib.request.urlopen(request, timeout=30) as answer:
                for line in answer.read().decode().splitlines():
                    if line.startswith("metaros_http_requests_total{") and "/healthz" in line:
                        found[name] += float(line.split()[-1])
        return found

    def _gone(self) -> bool:
        return self.nginx is None or self.nginx.poll() is not None

    def __exit__(self, *_exc: object) -> None:
        if self.nginx is not None:
            end(self.nginx)
        super().__exit__()


@pytest.mark.integration
@pytest.mark.skipif(sys.platform != "linux", reason="containers are Linux's; 127.0.0.9 is too")
def test_its_lines_serve_behind_its_nginx(
    postgres: PostgresServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    with OneHost(tmp_path) as host:
        host.prepare(postgres)
        monkeypatch.setenv("METAROS_STORE", host.store)
        host.up()
        assert [host.direct_get("/readyz", name) for name in GATEWAYS] == [200, 200]
        assert host.direct_get("/", "gateway-1") == 403, "who is not nginx gets nothing"
        assert host.https_get("/") == 200, "the dashboard"
        assert host.https_get("/api/v1/robots") == 401, "nobody is an anonymous viewer behind a proxy"
        where = ("--data-dir", str(tmp_path / "gateway-1" / "gateway"))
        made = host.run_once("key", "create", "--name", "test", "--role", "admin", *where)
        key = re.search(r"mrk_\S+", made)
        assert key
        assert host.https_get("/api/v1/robots", Authorization=f"Bearer {key[0]}") == 200
        monkeypatch.setenv("METAROS_KEY", key[0])
        monkeypatch.setenv("METAROS_CA", str(host.certificate))
        monkeypatch.setenv("SSL_CERT_FILE", str(host.certificate))
        host.enrol("arm_1")
        wait_until(lambda: host.sees("arm_1") == list(GATEWAYS), timeout_s=60)
        usual = host.takes()
        first, second = (program for program in host.programs if program.name in GATEWAYS)
        for gone, left in ((first, second), (second, first)):
            gone.kill()
            assert host.https_get("/api/v1/robots", Authorization=f"Bearer {key[0]}") == 200, f"{left.name} serves"
            wait_until(lambda name=left.name: name in host.sees("arm_1"), timeout_s=60)  # type: ignore[misc]
            host.restart(gone)
            wait_until(lambda: host.sees("arm_1") == list(GATEWAYS), timeout_s=60)
            wait_until(lambda: host.takes() == usual, timeout_s=60)  # nginx, too, knows that it is back
