"""Sound both ways through the real programs and Chromium: its microphone is a file, the robot's devices are ALSA's."""

from __future__ import annotations

import json
import os
import urllib.request
import wave
from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.e2e.chromium import Chromium, sign_in
from tests.e2e.conftest import save
from tests.e2e.real.gateway import real_stack
from tests.support.devices.alsa import MIC, SPEAKER, Alsa, strongest_hz, tone
from tests.support.gateways.viewer import open_socket
from tests.support.processes.stack import Stack
from tests.support.waiting import wait_until

pytestmark = [
    pytest.mark.browser,
    pytest.mark.integration,
    pytest.mark.xdist_group("browser"),
    pytest.mark.timeout(400),
]

RATE, HZ = 48000, 880.0


@pytest.fixture(scope="module")
def alsa(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Alsa]:
    """Sound devices for the module's processes."""
    with pytest.MonkeyPatch.context() as patch:
        made = Alsa(tmp_path_factory.mktemp("alsa"), patch)
        made.say(tone(440, 600, 16000))
        yield made


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory, alsa: Alsa) -> Iterator[Stack]:
    """A gateway, and a robot r1 with a microphone and a speaker."""
    with real_stack(tmp_path_factory.mktemp("sound")) as stack:
        stack.router()
        for kind, params in (
            ("speaker", (f"device={SPEAKER}", f"rate={RATE}")),
            ("microphone", (f"device={MIC}", "output=both")),
        ):
            options = [option for param in params for option in ("--param", param)]
            where = ("--namespace", "/r1", "--zenoh-port", str(stack.zenoh_port))
            stack.start(kind, "driver", "run", kind, *where, *options, ready=False)
        stack.agent("r1")
        wait_until(lambda: {"/r1/audio", "/r1/audio/opus", "/r1/speaker/talk"} <= set(stack.topics("r1")))
        yield stack


@pytest.fixture(scope="module")
def hearing(one_chromium: Chromium, stack: Stack) -> Iterator[Browser]:
    """A Chromium whose microphone hears the tone."""
    said = stack.folder / "said.wav"
    with wave.open(str(said), "wb") as file:
        file.setparams((1, 2, RATE, 0, "NONE", "not compressed"))
        file.writeframes(tone(HZ, 10, RATE).tobytes())
    arguments = ["--use-fake-device-for-media-stream", "--use-fake-ui-for-media-stream"]
    arguments += [f"--use-file-for-fake-audio-capture={said}", "--autoplay-policy=document-user-activation-required"]
    env = {name: value for name, value in os.environ.items() if name != "ALSA_CONFIG_PATH"}
    with one_chromium.used():
        started = one_chromium.launch(*arguments, env={**env})
    yield started
    with one_chromium.used():
        started.close()


@pytest.fixture
def robot_page(stack: Stack, chromium: Chromium, hearing: Browser) -> Iterator[Callable[..., Page]]:
    """Open the robot's page there, signed in."""
    pages: list[Page] = []
    errors: list[str] = []

    def opened(*, init: str = "") -> Page:
        page = hearing.new_page(viewport={"width": 1440, "height": 900})
        pages.append(page)
        page.set_default_timeout(60_000)
        page.on("pageerror", lambda error: errors.append(str(error)))
        if init:
            page.add_init_script(init)
        sign_in(page, sign_in_link(stack))
        page.goto(f"{stack.url}/robots/r1")
        return page

    yield opened
    for page in pages:
        page.close()
    assert errors == []


def sign_in_link(stack: Stack) -> str:
    headers = {"Authorization": f"Bearer {stack.key}", "Content-Type": "application/json"}
    request = urllib.request.Request(f"{stack.url}/api/v1/auth/links", b"{}", headers)
    with urllib.request.urlopen(request, timeout=60) as answer:
        return str(json.load(answer)["url"])


def silent(alsa: Alsa) -> bool:
    return not alsa.played()[-round(0.3 * RATE) :].any()


@pytest.mark.parametrize("codec", ["opus", "pcm-s16"])
def test_what_is_said_into_the_page_is_received(
    stack: Stack, alsa: Alsa, robot_page: Callable[..., Page], codec: str
) -> None:
    page = robot_page(init="" if codec == "opus" else "delete window.AudioEncoder")
    before = len(alsa.played())
    row, button = page.locator("[data-talk]"), page.locator(".audio-talk")
    button.scroll_into_view_if_needed()
    button.hover()
    page.mouse.down()
    expect(row).to_have_attribute("data-talk", "talking")

    def received_hz() -> float:
        page.wait_for_timeout(100)
        return strongest_hz(alsa.played()[before:], RATE)[0]

    wait_until(lambda: abs(received_hz() - HZ) < 5)
    save(page, "talk")
    with open_socket(stack.url, "/api/v1/robots/r1/talk", key=stack.key) as other:
        other.send(json.dumps({"op": "take", "holder": "bob", "codec": codec, "sample_rate": RATE}))
        assert json.loads(other.recv(timeout=60))["code"] == "lease_taken"
    page.mouse.up()
    expect(row).to_have_attribute("data-talk", "armed")
    wait_until(lambda: silent(alsa))
    expect(row).to_have_attribute("data-talk", "idle")  # the lease is given back
    button.focus()
    page.keyboard.down("Space")
    wait_until(lambda: page.wait_for_timeout(100) or not silent(alsa))
    page.keyboard.up("Space")
    wait_until(lambda: page.wait_for_timeout(100) or silent(alsa))


def test_who_talks_already_is_named(stack: Stack, robot_page: Callable[..., Page]) -> None:
    page = robot_page()
    with open_socket(stack.url, "/api/v1/robots/r1/talk", key=stack.key) as other:
        other.send(json.dumps({"op": "take", "holder": "bob", "codec": "opus", "sample_rate": RATE}))
        assert json.loads(other.recv(timeout=60))["op"] == "granted"
        button = page.locator(".audio-talk")
        button.hover()
        for _ in range(50):  # bob says nothing, but holds on to it by asking again
            page.mouse.down()
            page.wait_for_timeout(200)
            other.send(bytes(4))
            if page.locator("[data-talk=refused]").count():
                break
        expect(page.locator("[data-talk=refused]")).to_contain_text("bob is talking")
        page.mouse.up()


@pytest.mark.parametrize("codec", ["opus", "pcm-s16"])
def test_a_robot_is_listened_to(robot_page: Callable[..., Page], codec: str) -> None:
    page = robot_page(init="" if codec == "opus" else "delete window.AudioDecoder")
    row = page.locator("[data-listen]").filter(has_text="audio/opus" if codec == "opus" else "audio")
    expect(row).to_have_count(1)
    row.get_by_role("button").click()
    wait_until(lambda: page.wait_for_timeout(100) or float(row.get_attribute("data-peak") or 0) > 0.3)
    expect(row.locator(".audio-note")).to_contain_text("ms")
    save(page, f"listen-{codec}")
    row.get_by_role("button").click()
    expect(row).to_have_attribute("data-peak", "0.000")
