"""From nothing to an enrolled robot over mTLS, by the commands of docs/howto/enrol_a_robot.md as they stand there.

Real processes: a gateway with TLS by its own root, the administrator's command line and the robot, each in a home of
its own. Nothing is filled in but the ports.
"""

from __future__ import annotations

import re
import shlex
import ssl
from pathlib import Path

import grpc
import httpx
import pytest

from edge_agent.identity.files import IdentityFiles
from gateway.domain.host_names import outward_address
from gateway.identity.local_key import LOCAL_KEY_FILE
from metaros._proto import link_pb2, link_pb2_grpc
from tests.support.processes.command_line import call_metaros
from tests.support.processes.stack import Program, Stack
from tests.support.waiting import wait_until

GUIDE = Path(__file__).parents[3] / "docs" / "howto" / "enrol_a_robot.md"
DATA = Path(".metaros") / "gateway"

pytestmark = [
    pytest.mark.integration,
    pytest.mark.skipif(not outward_address(), reason="this machine has no address but loopback"),
]


def written(beginning: str) -> str:
    """The first command of the page that begins so."""
    blocks = re.findall(r"^```\n(.*?)^```", GUIDE.read_text(), re.DOTALL | re.MULTILINE)
    return next(line for block in blocks for line in block.splitlines() if line.startswith(beginning))


def run(command: str, home: Path) -> str:
    """A command as somebody types it, in that home."""
    environ = {"HOME": str(home), "METAROS_RUNTIME_DIR": str(home / "run")}
    done = call_metaros(*shlex.split(command)[1:], **environ)
    assert done.code == 0, done.err
    return done.out


def reach(stack: Stack, root: Path | None) -> str:
    """How the robots' port answers a lane: the status of a call, with TLS by this root, or without."""
    place = f"127.0.0.1:{stack.grpc_port}"
    trust = grpc.ssl_channel_credentials(root.read_bytes()) if root is not None else None
    with grpc.secure_channel(place, trust) if trust is not None else grpc.insecure_channel(place) as opened:
        try:
            lane = link_pb2_grpc.LinkStub(opened).Connect(iter([link_pb2.AgentFrame()]), timeout=60)
            return str(next(lane))
        except grpc.RpcError as error:
            code: grpc.StatusCode = error.code()  # type: ignore[attr-defined]
            return code.name


def online(stack: Stack, data: Path) -> set[str]:
    """Who is online, as the gateway says over its own TLS."""
    key = (data / LOCAL_KEY_FILE).read_text().strip()
    url = f"https://127.0.0.1:{stack.http_port}/api/v1/robots"
    trust = ssl.create_default_context(cafile=data / "root.pem")
    answer = httpx.get(url, headers={"Authorization": f"Bearer {key}"}, verify=trust, trust_env=False, timeout=30)
    return {robot["id"] for robot in answer.json()["robots"] if robot["state"] == "online"}


def start_gateway(stack: Stack) -> Program:
    """The page's gateway, on free ports."""
    words = shlex.split(written("metaros gateway"))[1:]
    return stack.start("gateway", *words, "--port", str(stack.http_port), "--grpc-port", str(stack.grpc_port))


def goes_home(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What starts from now on is of whoever lives there."""
    home.mkdir(exist_ok=True)
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.setenv("METAROS_RUNTIME_DIR", str(home / "run"))


def test_two_commands_make_a_robot_that_speaks_mtls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    office, data = tmp_path / "office", tmp_path / "office" / DATA
    with Stack(tmp_path) as stack:
        stack.router()
        goes_home(office, monkeypatch)
        run(written("metaros user add").replace("~", str(office)), office)
        start_gateway(stack)
        # Without TLS, and with TLS but no certificate, the robots' port ends it before a frame is read.
        assert (reach(stack, None), reach(stack, data / "root.pem")) == ("UNAVAILABLE", "UNAVAILABLE")
        copies_the_name_alone(stack, data, monkeypatch)
        for transport in ("grpc", "websocket"):
            goes_home(tmp_path / transport, monkeypatch)
            speaks_mtls(stack, office, tmp_path / transport, transport)


def copies_the_name_alone(stack: Stack, data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Somebody whom nobody enrolled is refused."""
    goes_home(stack.folder / "thief", monkeypatch)
    with monkeypatch.context() as patched:
        patched.setenv("SSL_CERT_FILE", str(data / "root.pem"))  # it even trusts the gateway
        url = f"https://127.0.0.1:{stack.http_port}"
        thief = stack.start("thief-agent", "agent", "--name", "arm_1", "--gateway", url, "--no-host-metrics")
    wait_until(lambda: "not_enrolled" in thief.output)
    assert "link up" not in thief.output
    thief.kill()


def speaks_mtls(stack: Stack, office: Path, robot: Path, transport: str) -> None:
    """The page's commands, in the office and on the robot; until the office takes the identity away."""
    data = office / DATA
    reported = run(written("metaros robot token"), office).splitlines()[0]
    shape = re.sub(r"mr1\.\S+", "mr1.…", reported)
    shape = re.sub(r"https://\S+", "https://fleet.example:8080", shape)
    assert shape == written("metaros agent enrol")  # what is printed is what the page shows
    assert "enrolled arm_1" in run(reported, robot)

    chosen = robot / "agent.toml"
    chosen.write_text(f'transport = "{transport}"\n')
    words = [*shlex.split(written("metaros agent --name"))[1:], "--config", str(chosen), "--no-host-metrics"]
    agent = stack.start(f"{transport}-agent", *words)
    wait_until(lambda: "link up" in agent.output)
    wait_until(lambda: "arm_1" in online(stack, data), every_s=0.1)
    scheme = "grpcs" if transport == "grpc" else "https"
    assert re.search(rf"link up: gateway \w+ at {scheme}://\S+ by {transport}", agent.output), agent.output

    identity = IdentityFiles(robot / ".metaros" / "agent" / "arm_1").load()
    assert identity is not None
    assert (identity.robot, identity.grpc_tls, identity.system_trust) == ("arm_1", True, False)
    assert identity.roots == (data / "root.pem").read_text()

    listed = run("metaros robot identities -o json", office)
    assert '"arm_1"' in listed
    assert '"active"' in listed
    run('metaros robot revoke arm_1 --reason "lost on the way"', office)
    wait_until(lambda: "certificate_revoked" in agent.output)
    wait_until(lambda: "arm_1" not in online(stack, data), every_s=0.1)
    agent.kill()
