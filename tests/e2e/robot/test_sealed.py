"""A sealed topic in a real browser: a lock, and its messages once a keyring was chosen."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from metaros.clock import SystemClock
from metaros.idl import type_hash
from metaros.seal import SEALED_CDR, Keyring, Origin, Sealer, SealKey
from tests.e2e.fake.gateway import FakeGateway
from tests.e2e.fake.robots import QUIET, TOPICS, FakeRobot, FakeTopic

pytestmark = [pytest.mark.browser, pytest.mark.xdist_group("browser")]
PANELS = ("odom", "scan", "imu", "camera/image/compressed")
MAP = "[data-card=map] canvas"


class SealedRobot(FakeRobot):
    """Topics of it are sealed; a subscription's numbers begin at 1, as the fake gateway counts them."""

    def seal_with(self, ring: Keyring, *names: str) -> None:
        """Seal the topics of these names by this keyring."""
        self.sealer = Sealer(ring, SystemClock())
        self.seqs = dict.fromkeys(names, 0)

    def describe_topic(self, number: int, topic: FakeTopic) -> dict[str, Any]:
        """As of any robot, but for the encoding."""
        described = super().describe_topic(number, topic)
        return {**described, "encoding": SEALED_CDR} if topic.name in self.seqs else described

    def describe_channel(self, number: int, topic: FakeTopic) -> dict[str, Any]:
        """Likewise; a subscription begins."""
        described = super().describe_channel(number, topic)
        if topic.name not in self.seqs:
            return described
        self.seqs[topic.name] = 0
        return {**described, "encoding": SEALED_CDR}

    def encode(self, topic: FakeTopic, at_s: float) -> bytes:
        """The message, sealed."""
        payload = super().encode(topic, at_s)
        if topic.name not in self.seqs:
            return payload
        self.seqs[topic.name] += 1
        kind = topic.type
        origin = Origin(robot=self.id, topic=self.topic(topic.name), type_name=kind, type_hash=type_hash(kind))
        return self.sealer.seal(payload, origin, stream=7, epoch=1, seq=self.seqs[topic.name])


@pytest.fixture
def ring() -> Keyring:
    """A new one."""
    return Keyring((SealKey.make(SystemClock()),))


@pytest.fixture(params=[("note",)], ids=["note"])
def sealed(request: pytest.FixtureRequest, fake_gateway: FakeGateway, ring: Keyring) -> FakeGateway:
    """One robot with sealed topics: its note, or those that a test names."""
    reported = TOPICS if request.param == PANELS else QUIET
    robot = SealedRobot("sim_1", "/sim_1", note="the safe is open", told=reported)
    robot.seal_with(ring, *request.param)
    fake_gateway.begin([robot])
    return fake_gateway


def choose(page: Page, path: Path) -> None:
    """Choose a keyring on the Topics page."""
    page.get_by_role("button", name="Topics").click()
    expect(page.locator("tr[data-topic='/sim_1/note'] [data-sealed]")).to_be_visible()
    expect(page.locator("[data-sealed]")).to_have_count(1)
    page.locator("[data-unlock] input").set_input_files(path)


def other_keyring(path: Path) -> Path:
    """A file with a key that sealed nothing."""
    Keyring((SealKey.make(SystemClock()),)).save(path)
    return path


def test_a_sealed_topic_has_a_lock_and_opens_with_its_keyring_alone(
    sealed: FakeGateway, ring: Keyring, open_page: Callable[..., Page], tmp_path: Path
) -> None:
    page = open_page(f"{sealed.url}/robots/sim_1")
    card = page.locator("[data-card=tree][data-topic='/sim_1/note']")
    card.locator("summary").click()
    expect(card).to_contain_text("sealed: open it with its keyring")
    other, right = tmp_path / "other.keys", tmp_path / "right.keys"
    other_keyring(other)
    ring.save(right)
    choose(page, other)
    expect(page.locator("[data-unlock]")).to_contain_text("opens with key")
    page.get_by_role("button", name="Live", exact=True).click()
    card.locator("summary").click()
    expect(card).to_contain_text("which is not here")
    expect(card).not_to_contain_text("the safe is open")
    choose(page, right)
    expect(page.locator("[data-unlock]")).to_contain_text(ring.current.key_id.hex())
    page.get_by_role("button", name="Live", exact=True).click()
    card.locator("summary").click()
    expect(card).to_contain_text("the safe is open")


@pytest.mark.parametrize("sealed", [PANELS], indirect=True, ids=["panels"])
def test_map_camera_and_plot_say_that_they_are_sealed_and_open(
    sealed: FakeGateway, ring: Keyring, open_page: Callable[..., Page], tmp_path: Path
) -> None:
    page = open_page(f"{sealed.url}/robots/sim_1")
    cards = [page.locator(f"[data-card={kind}]") for kind in ("map", "camera", "imu")]
    for card in cards:
        expect(card.locator(".problem")).to_contain_text("sealed: open it with its keyring")
    choose_here = page.locator("[data-unlock]")
    (tmp_path / "none.keys").write_text("{}")
    choose_here.locator("input").set_input_files(tmp_path / "none.keys")
    expect(choose_here).to_contain_text("that is no keyring")
    choose_here.locator("input").set_input_files(other_keyring(tmp_path / "other.keys"))
    for card in cards:
        expect(card.locator(".problem")).to_contain_text("which is not here: your keyring holds another")
    ring.save(tmp_path / "right.keys")
    choose_here.locator("input").set_input_files(tmp_path / "right.keys")
    for card in cards:
        expect(card.locator(".problem")).to_have_count(0)
    page.wait_for_function(f"() => Number(document.querySelector({MAP!r})?.dataset.scans) > 3")
    page.wait_for_function("() => Number(document.querySelector('[data-card=camera] canvas')?.dataset.frames) > 3")
