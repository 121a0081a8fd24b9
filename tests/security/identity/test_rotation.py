"""docs/howto/rotate_keys.md, performed: its own commands on a real gateway and a real agent, and what they promise."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import pytest

import metaros
from edge_agent.errors import EnrolRefusedError
from edge_agent.identity.enrol import enrol, renew
from edge_agent.identity.enrolment_token import parse_token, spki_pin
from edge_agent.identity.files import IdentityFiles, RobotIdentity
from metaros.errors import MetarosError
from metaros.interfaces.std_msgs.msg import String
from metaros.record import open_bag
from tests.docs.console import Command, World, commands_of, environment, matches
from tests.support.gateways.memory_authenticator import bearer
from tests.support.gateways.plain_http import TRUSTS_NOBODY
from tests.support.processes.command_line import Done, call_metaros
from tests.support.waiting import wait_until

PAGE = Path(__file__).resolve().parents[3] / "docs" / "howto" / "rotate_keys.md"
MARKER = "sealed before anything was rotated"


def sections() -> dict[str, list[Command]]:
    """The page's commands, by its headings."""
    parts = re.split(r"^## (.+)$", PAGE.read_text(), flags=re.MULTILINE)
    return {title: commands_of(text) for title, text in zip(["", *parts[1::2]], [parts[0], *parts[2::2]], strict=True)}


@dataclass
class Fleet:
    """What the page has started, and what was kept of it to try again later."""

    world: World
    http: httpx.Client
    kept: dict[str, Any] = field(default_factory=dict)

    @property
    def folder(self) -> Path:
        """Where the page's commands run."""
        return self.world.folder

    @property
    def url(self) -> str:
        """The gateway."""
        return f"http://127.0.0.1:{self.world.ports['8090']}"

    @property
    def admin(self) -> str:
        """The local key."""
        return (self.folder / "kept" / "local.key").read_text().strip()

    def identity(self, robot: str = "arm_1") -> RobotIdentity:
        """What the robot has on its disk now."""
        found = IdentityFiles(self.folder / ".metaros" / "agent" / robot).load()
        assert found is not None
        return found

    def get(self, path: str, key: str = "") -> httpx.Response:
        """Ask the gateway; as the local admin, unless another key is given."""
        return self.http.get(self.url + path, headers=bearer(key or self.admin))

    def online(self) -> bool:
        """Whether the gateway has the robot's link."""
        robots = self.get("/api/v1/robots").json()["robots"]
        return [robot["id"] for robot in robots if robot["state"] == "online"] == ["arm_1"]

    def issuers(self) -> list[dict[str, Any]]:
        """What `metaros ca list` shows."""
        done = self.run("ca", "list", "--data-dir", "kept", "-o", "json")
        found: list[dict[str, Any]] = json.loads(done.out)
        return found

    def run(self, *arguments: str, code: int = 0) -> Done:
        """A command of the test's own."""
        done = call_metaros(*arguments, folder=self.folder)
        assert done.code == code, done.out + done.err
        return done

    def say(self, text: str) -> None:
        """Publish on the topic that the robot seals, until the gateway has one more of it."""

        def received() -> int:
            topics = self.get("/api/v1/robots/arm_1/topics").json()["topics"]
            return sum(int(topic["received"]) for topic in topics if topic["topic"] == "/secret")

        before = received()
        with metaros.Context(connect=self.world.endpoint) as context:
            node = metaros.Node("source", context=context)
            publisher = node.create_publisher(String, "/secret", metaros.qos_reliable_all)

            def arrived() -> bool:
                publisher.publish(String(data=text))
                return received() > before

            wait_until(arrived)

    def other_robot(self, name: str) -> RobotIdentity:
        """A robot that is enrolled, and then off."""
        token = self.token(name)
        state = self.folder / ".metaros" / "agent" / name
        return enrol(parse_token(token), url=self.url, robot_id=name, state_dir=state)

    def token(self, name: str) -> str:
        """A token for it."""
        body = {"robot": name}
        made = self.http.post(f"{self.url}/api/v1/enrolment-tokens", json=body, headers=bearer(self.admin))
        assert made.status_code == 201, made.text
        return str(made.json()["token"])

    def refused(self, identity: RobotIdentity) -> str:
        """Why a renewal of this identity is refused."""
        with pytest.raises(EnrolRefusedError) as error:
            renew(identity, self.folder / "stranger")
        return error.value.reason


def pins(identity: RobotIdentity) -> list[str]:
    """The roots that a robot trusts."""
    from cryptography import x509

    return [spki_pin(root) for root in x509.load_pem_x509_certificates(identity.roots.encode())]


def started(fleet: Fleet) -> None:
    """After the preparation: the robot is there, seals, and another one is off."""
    wait_until(fleet.online)
    fleet.say(MARKER)
    fleet.kept["first"] = fleet.identity()
    fleet.kept["off"] = fleet.other_robot("arm_2")


def before_renewal(fleet: Fleet) -> None:
    """The link has not noticed that another issuer issues."""
    assert fleet.online()
    assert fleet.identity().certificate == fleet.kept["first"].certificate


def before_retiring(fleet: Fleet) -> None:
    """The robot that is there has renewed by itself; the other holds retirement up, and renews when it comes back."""
    wait_until(lambda: fleet.identity().certificate != fleet.kept["first"].certificate)
    wait_until(fleet.online)
    wait_until(lambda: fleet.issuers()[0]["robots"] == 1)
    reported = fleet.run("ca", "retire", "--data-dir", "kept", code=1).err
    assert "arm_2" in reported
    assert "arm_1" not in reported
    fleet.kept["off"] = renew(fleet.kept["off"], fleet.folder / ".metaros" / "agent" / "arm_2")
    assert fleet.issuers()[0]["robots"] == 2


def issuer_retired(fleet: Fleet) -> None:
    """Who holds a certificate of the old issuer is a stranger; the robots are not."""
    wait_until(lambda: fleet.refused(fleet.kept["first"]) == "certificate_foreign")
    fleet.kept["first"] = fleet.identity()
    wait_until(fleet.online)
    fleet.say("after the issuer")


def before_the_root_goes(fleet: Fleet) -> None:
    """Both robots trust both roots, on the disk."""
    fleet.kept["old root"] = pins(fleet.kept["first"])
    fleet.kept["token"] = fleet.token("arm_3")
    before_retiring(fleet)
    assert len(pins(fleet.identity())) == 2
    assert pins(fleet.kept["off"])[-1:] != fleet.kept["old root"] or len(pins(fleet.kept["off"])) == 2


def root_retired(fleet: Fleet) -> None:
    """The old chain is refused, old tokens too; robots go on, and drop the old root at their next renewal."""
    wait_until(lambda: fleet.refused(fleet.kept["first"]) == "certificate_foreign")
    state = fleet.folder / "arm_3"
    with pytest.raises(MetarosError):
        enrol(parse_token(fleet.kept["token"]), url=fleet.url, robot_id="arm_3", state_dir=state)
    wait_until(fleet.online)
    fleet.say("after the root")
    again = renew(fleet.kept["off"], fleet.folder / ".metaros" / "agent" / "arm_2")
    assert len(pins(again)) == 1
    assert pins(again) != fleet.kept["old root"]


def before_rekeying(fleet: Fleet) -> None:
    """A key whose secret is sealed, beside the issuer's."""
    fleet.kept["master"] = (fleet.folder / "kept" / "master.key").read_bytes()
    fleet.run("key", "create", "--name", "fn", "--role", "viewer", "--scope", "lambda", "--data-dir", "kept")


def rekeyed(fleet: Fleet) -> None:
    """Another key; the gateway that runs all the while issues certificates and seals with it."""
    folder = fleet.folder / "kept"
    assert (folder / "master.key").read_bytes() != fleet.kept["master"]
    assert not (folder / "master.key.next").exists()
    fleet.other_robot("arm_4")
    assert fleet.online()


def before_revoking(fleet: Fleet) -> None:
    """The old key and the new one both work."""
    for name in ("old", "new"):
        fleet.kept[name] = json.loads((fleet.folder / f"{name}.json").read_text())["key"]
        assert fleet.get("/api/v1/auth/me", fleet.kept[name]).status_code == 200


def revoked(fleet: Fleet) -> None:
    """The old one does not."""
    wait_until(lambda: fleet.get("/api/v1/auth/me", fleet.kept["old"]).json().get("code") == "bad_credentials")
    assert fleet.get("/api/v1/auth/me", fleet.kept["new"]).status_code == 200


def before_signing_out(fleet: Fleet) -> None:
    """Ada is signed in."""
    headers = {"Origin": fleet.url}
    ada = httpx.Client(base_url=fleet.url, headers=headers, timeout=60, trust_env=False, verify=TRUSTS_NOBODY)
    assert ada.post("/api/v1/auth/login", json={"name": "ada", "password": "correct horse battery"}).status_code == 200
    assert ada.get("/api/v1/auth/me").json()["name"] == "ada"
    fleet.kept["ada"] = ada
    fleet.run("user", "signout", "ada", "--data-dir", "kept")  # the page's own says that nobody was signed in


def signed_out(fleet: Fleet) -> None:
    """Her cookie opens nothing."""
    ada = fleet.kept["ada"]
    wait_until(lambda: ada.get("/api/v1/auth/me").json().get("name") != "ada")
    ada.close()


def zenoh_rotated(fleet: Fleet) -> None:
    """The old password opens no session with the new router, the new one does."""
    zenoh, before = fleet.folder / "zenoh", fleet.folder / "zenoh-before"
    assert (zenoh / "users").read_text() != (before / "users").read_text()
    old, new = before / "node.json5", zenoh / "node.json5"
    with metaros.Context(environ={"ZENOH_SESSION_CONFIG_URI": str(new)}):
        pass
    with pytest.raises(MetarosError):
        metaros.Context(environ={"ZENOH_SESSION_CONFIG_URI": str(old)})


def sealed_anew(fleet: Fleet) -> None:
    """The agent seals with the new key; what was sealed before anything was rotated opens, too."""
    fleet.say("after the keys")
    target, opened = fleet.folder / "sealed.mcap", fleet.folder / "opened.mcap"

    def all_there() -> bool:
        target.unlink(missing_ok=True)
        span = ("--robot", "arm_1", "--start", "-1h", "--gateway", fleet.url)
        done = call_metaros("history", "export", str(target), *span, METAROS_KEY=fleet.admin)
        assert done.code == 0, done.err
        sealed = [message.data for message in open_bag(target).messages(["/secret"])]
        fleet.say("after the keys")
        return len({payload[1:9] for payload in sealed}) == 2

    wait_until(all_there)
    keyring = fleet.folder / ".metaros" / "agent" / "arm_1" / "seal.keys"
    fleet.run("seal", "open", str(target), str(opened), "--keyring", str(keyring))
    texts = [message.data for message in open_bag(opened).messages(["/secret"])]
    assert any(MARKER.encode() in text for text in texts)
    assert any(b"after the keys" in text for text in texts)


# What is looked at before a command of a section, by how the command begins, and at the section's end.
BEFORE: dict[tuple[str, str], Callable[[Fleet], None]] = {
    ("The issuer of robots' certificates", "metaros ca renew"): before_renewal,
    ("The issuer of robots' certificates", "metaros ca retire"): before_retiring,
    ("The root", "metaros ca renew"): before_renewal,
    ("The root", "metaros ca retire"): before_the_root_goes,
    ("The master key", "metaros gateway rekey"): before_rekeying,
    ("API keys", "metaros key revoke"): before_revoking,
    ("People", "metaros user signout ada"): before_signing_out,
}
AFTER: dict[str, Callable[[Fleet], None]] = {
    "": started,
    "The issuer of robots' certificates": issuer_retired,
    "The root": root_retired,
    "The master key": rekeyed,
    "API keys": revoked,
    "People": signed_out,
    "Passwords of a robot's Zenoh": zenoh_rotated,
    "Keys of sealed topics": sealed_anew,
}


@pytest.fixture
def fleet(zenoh_router: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Fleet]:
    """A place for the page's commands, with the file that it shows."""
    for name, value in environment(zenoh_router, tmp_path).items():
        monkeypatch.setenv(name, value)
    monkeypatch.delenv("METAROS_KEY", raising=False)
    monkeypatch.chdir(tmp_path)
    shown = re.search(r"```toml\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert shown is not None
    (tmp_path / "arm_1.toml").write_text(shown[1])
    world = World(zenoh_router, tmp_path)
    with world.page(), httpx.Client(timeout=60, trust_env=False, verify=TRUSTS_NOBODY) as http:
        yield Fleet(world, http)
    shutil.rmtree(tmp_path / "kept", ignore_errors=True)


@pytest.mark.integration
@pytest.mark.timeout(900)  # some forty programs, one after the other
def test_the_page_is_performed_and_keeps_its_promises(fleet: Fleet) -> None:
    reached = set()
    for title, commands in sections().items():
        for command in commands:
            for place, check in BEFORE.items():
                if place[0] == title and command.text.startswith(place[1]):
                    check(fleet)
                    reached.add(place)
            printed = fleet.world.run(command)
            sample = [line for line in command.sample if line != "^C"]
            assert matches(sample, printed), f"{title}: {command.text}\nprinted:\n{printed}"
        if title in AFTER:
            AFTER[title](fleet)
    assert reached == BEFORE.keys()
    assert AFTER.keys() <= sections().keys()
