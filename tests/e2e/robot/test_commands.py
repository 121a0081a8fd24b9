"""The Commands tab over a real gateway: what a robot was told, how far it is, and the form that tells it more."""

from __future__ import annotations

import asyncio
import itertools
import threading
from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Locator, Page, Route, expect

from metaros._proto import link_pb2
from metaros.cdr import codec
from metaros.idl import message_class
from tests.e2e.conftest import PHONE, save
from tests.e2e.readable import unreadable
from tests.e2e.real.gateway import RealGateway, real_gateway
from tests.e2e.real.scripted_robot import robot_that_left, scripted_robot
from tests.gateway.harness import CONTROL, ScriptedAgent, channel

pytestmark = [
    pytest.mark.browser,
    pytest.mark.integration,
    pytest.mark.xdist_group("browser"),
    pytest.mark.timeout(300),
]

OpenPage = Callable[..., Page]
TRIGGER = "std_srvs/srv/Trigger"
MARKUP = "<img src=x onerror='window.__ran=1'>"
NUMBERS = itertools.count(1)  # each test's robot has one


class Worker:
    """What a robot does with commands: most go well, /broken does not, /slow waits until the test lets it."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.go_on = threading.Event()
        self.done: list[link_pb2.Command] = []

    async def obey(self, robot: ScriptedAgent) -> None:
        """Say that it can be driven, and answer for ever."""
        await robot.announce(channel(1, f"/{self.name}/cmd_vel", "geometry_msgs/msg/Twist"))
        while True:
            command = (await robot.next("command", timeout_s=3600.0)).command
            self.done.append(command)
            service = command.call_service.service
            if service.endswith("/broken"):
                await robot.answer(command, code="no_such_service")
            elif service.endswith("/slow"):
                await robot.send(CONTROL, result=link_pb2.CommandResult(command_id=command.command_id, running=True))
                await asyncio.to_thread(self.go_on.wait)
                await robot.answer(command, payload=_answer("moved on"))
            elif service:
                await robot.answer(command, payload=_answer(MARKUP))
            else:
                await robot.answer(command)


def _answer(text: str) -> bytes:
    return codec(f"{TRIGGER}_Response").encode(message_class(f"{TRIGGER}_Response")(success=True, message=text))


@pytest.fixture(scope="module")
def gateway(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RealGateway]:
    """ada is an operator."""
    with real_gateway(tmp_path_factory.mktemp("commands"), robot=False) as running:
        running.user("ada", "operator")
        yield running


@pytest.fixture
def worker(gateway: RealGateway) -> Iterator[Worker]:
    """A robot of the test's own that obeys."""
    made = Worker(f"arm_{next(NUMBERS)}")
    with scripted_robot(gateway.ready, made.name, obey=made.obey):
        yield made
        made.go_on.set()  # nothing waits for ever


@pytest.fixture
def absent(gateway: RealGateway) -> str:
    """A robot of the test's own that was here once."""
    name = f"gone_{next(NUMBERS)}"
    robot_that_left(gateway, name)
    return name


def commands_of(gateway: RealGateway, open_page: OpenPage, robot: str, **options: object) -> Page:
    """Ada's page of a robot's commands."""
    page = open_page(f"{gateway.url}/robots/{robot}?tab=commands", link=gateway.link("ada"), **options)
    expect(page.get_by_role("button", name="Send a command…")).to_be_visible()
    return page


def form(page: Page) -> Locator:
    """The form, opened."""
    page.get_by_role("button", name="Send a command…").click()
    dialog = page.get_by_role("dialog")
    expect(dialog).to_be_visible()
    return dialog


def standings(row: Locator) -> list[str]:
    """The steps of a command in words."""
    found = row.locator(".step").evaluate_all("all => all.map(one => `${one.dataset.step} ${one.dataset.standing}`)")
    return [str(one) for one in found]


def rows(page: Page) -> Locator:
    """The history."""
    return page.locator("li[data-command]")


def test_a_service_is_called_and_its_answer_kept(gateway: RealGateway, worker: Worker, open_page: OpenPage) -> None:
    page = commands_of(gateway, open_page, worker.name)
    expect(page.locator(".nothing")).to_contain_text("got no command")
    dialog = form(page)
    save(page, "commands-form")
    dialog.get_by_label("Service", exact=True).fill(f"/{worker.name}/base/resume")
    expect(dialog.get_by_label("Type", exact=True)).to_have_value(TRIGGER)
    dialog.get_by_label("Request", exact=True).fill("{nonsense")
    dialog.get_by_role("button", name="Send", exact=True).click()
    expect(dialog.get_by_role("alert")).to_contain_text("This is no JSON")
    assert worker.done == []
    dialog.get_by_label("Request", exact=True).fill("{}")
    dialog.get_by_role("button", name="Send", exact=True).click()
    expect(page.get_by_role("dialog")).to_have_count(0)
    row = rows(page)
    expect(row).to_have_count(1)
    expect(row).to_have_attribute("data-state", "done")
    expect(row.locator("summary")).to_contain_text(f"Call /{worker.name}/base/resume")
    expect(row.locator("summary")).to_contain_text("ada")
    assert standings(row) == ["issued there", "delivered there", "running untold", "done there"]
    expect(row.get_by_label("Result")).to_contain_text(f'"message": "{MARKUP}"')
    assert page.evaluate("window.__ran") is None, "an answer is text, whatever it holds"
    save(page, "commands-done")
    row.get_by_role("button", name="Send again…").click()
    expect(page.get_by_role("dialog").get_by_label("Service", exact=True)).to_have_value(f"/{worker.name}/base/resume")
    page.get_by_role("dialog").get_by_role("button", name="Send").click()
    expect(rows(page)).to_have_count(2)
    assert len(worker.done) == 2


def test_a_durable_command_goes_step_by_step(gateway: RealGateway, worker: Worker, open_page: OpenPage) -> None:
    page = commands_of(gateway, open_page, worker.name)
    dialog = form(page)
    dialog.get_by_label("Service", exact=True).fill(f"/{worker.name}/slow")
    dialog.get_by_label("Type", exact=True).fill(TRIGGER)
    dialog.get_by_role("button", name="When the robot is there").click()
    dialog.get_by_role("button", name="12 h").click()
    dialog.get_by_role("button", name="Send", exact=True).click()
    row = rows(page)
    expect(row).to_have_attribute("data-state", "running")
    assert standings(row) == ["issued there", "delivered there", "running there", "done next"]
    expect(row.locator("summary")).to_contain_text("expires in 12\u202fh")
    expect(row.get_by_role("button", name="Take back")).to_have_count(0)
    save(page, "commands-running")
    worker.go_on.set()
    expect(row).to_have_attribute("data-state", "done")
    expect(row.locator("[data-step=done] .num")).to_contain_text("+")
    expect(row.get_by_label("Result")).to_contain_text("moved on")


def test_what_waits_for_an_absent_robot_can_be_taken_back(
    gateway: RealGateway, absent: str, open_page: OpenPage
) -> None:
    page = commands_of(gateway, open_page, absent)
    dialog = form(page)
    expect(dialog.get_by_role("button", name="When the robot is there")).to_have_attribute("aria-pressed", "true")
    dialog.get_by_role("radio", name="Node").check()
    dialog.get_by_label("Node", exact=True).fill("lidar")
    dialog.get_by_role("button", name="Signal", exact=True).click()
    dialog.get_by_role("button", name="USR1").click()
    dialog.get_by_role("button", name="Send", exact=True).click()
    row = rows(page)
    expect(row).to_contain_text("Send signal 10 to lidar")
    assert standings(row) == ["issued there", "delivered next", "running ahead", "done ahead"]
    row.get_by_role("button", name="Take back").click()
    save(page, "commands-take-back")
    page.get_by_role("dialog").get_by_role("button", name="Take it back").click()
    expect(row).to_have_attribute("data-state", "cancelled")
    assert standings(row) == ["issued there", "delivered missed", "running missed", "cancelled there"]
    dialog = form(page)
    dialog.get_by_role("button", name="Now", exact=True).click()
    expect(dialog).to_contain_text("sent now, it fails at once")
    dialog.get_by_label("Service", exact=True).fill(f"/{absent}/x")
    dialog.get_by_label("Type", exact=True).fill(TRIGGER)
    dialog.get_by_role("button", name="Send", exact=True).click()
    expect(rows(page)).to_have_count(2)
    expect(rows(page).first).to_have_attribute("data-state", "failed")
    page.get_by_label("State").select_option("cancelled")
    expect(rows(page)).to_have_count(1)
    assert page.url.endswith("tab=commands&state=cancelled")


def test_what_waits_is_done_when_its_robot_comes(gateway: RealGateway, absent: str, open_page: OpenPage) -> None:
    order = {"kind": "set_uplink", "request": {"bytes_per_s": 9000}, "durable": True}
    gateway.ask("POST", f"/robots/{absent}/commands", order)
    page = commands_of(gateway, open_page, absent)
    expect(rows(page)).to_have_attribute("data-state", "issued")
    with scripted_robot(gateway.ready, absent) as back:
        expect(rows(page)).to_have_attribute("data-state", "done")
        assert len(back.commands) == 1


def test_pressed_again_after_a_lost_answer_it_is_done_once(
    gateway: RealGateway, worker: Worker, open_page: OpenPage
) -> None:
    page = commands_of(gateway, open_page, worker.name, own=True)
    answers: list[int] = []

    def lose_the_first(route: Route) -> None:
        if route.request.method != "POST":
            return route.continue_()
        answer = route.fetch()
        answers.append(answer.status)
        return route.abort() if len(answers) == 1 else route.fulfill(response=answer)

    page.route(f"**/api/v1/robots/{worker.name}/commands", lose_the_first)
    dialog = form(page)
    dialog.get_by_label("Service", exact=True).fill(f"/{worker.name}/once")
    dialog.get_by_label("Type", exact=True).fill(TRIGGER)
    dialog.get_by_role("button", name="Send", exact=True).click()
    expect(dialog.get_by_role("alert")).to_contain_text("does not answer")
    dialog.get_by_role("button", name="Send", exact=True).click()
    expect(page.get_by_role("dialog")).to_have_count(0)
    expect(rows(page)).to_have_count(1)
    assert (answers, len(worker.done)) == ([200, 200], 1)


def test_a_refusal_says_why(gateway: RealGateway, worker: Worker, open_page: OpenPage) -> None:
    page = commands_of(gateway, open_page, worker.name)
    dialog = form(page)
    dialog.get_by_role("radio", name="Publish").check()
    dialog.get_by_label("Topic", exact=True).fill(f"/{worker.name}/cmd_vel")
    expect(dialog.get_by_label("Type", exact=True)).to_have_value("geometry_msgs/msg/Twist")
    expect(dialog).to_contain_text("drive pad alone")
    dialog.get_by_role("button", name="Send", exact=True).click()
    expect(dialog.get_by_role("alert")).to_contain_text("lease")
    save(page, "commands-refused")
    dialog.get_by_role("radio", name="Call a service").check()
    dialog.get_by_label("Service", exact=True).fill(f"/{worker.name}/broken")
    dialog.get_by_label("Type", exact=True).fill(TRIGGER)
    dialog.get_by_role("button", name="Send", exact=True).click()
    row = rows(page).first
    expect(row).to_have_attribute("data-state", "failed")
    expect(row.locator("summary")).to_contain_text("no_such_service")


def test_a_viewer_reads_and_sends_nothing(gateway: RealGateway, worker: Worker, open_page: OpenPage) -> None:
    gateway.ask("POST", f"/robots/{worker.name}/commands", {"kind": "set_uplink", "request": {"bytes_per_s": 50_000}})
    page = open_page(f"{gateway.url}/robots/{worker.name}?tab=commands")
    expect(rows(page)).to_contain_text("Limit the uplink to 50.0\u202fkB/s")
    expect(page.get_by_text("Operators may send commands.")).to_be_visible()
    expect(page.get_by_role("button", name="Send a command…")).to_have_count(0)
    rows(page).locator("summary").click()
    expect(page.get_by_role("button", name="Send again…")).to_have_count(0)


def test_older_ones_come_page_by_page(gateway: RealGateway, absent: str, open_page: OpenPage) -> None:
    for number in range(60):
        order = {"kind": "set_uplink", "request": {"bytes_per_s": 1000 + number}, "durable": True}
        gateway.ask("POST", f"/robots/{absent}/commands", order)
    page = commands_of(gateway, open_page, absent)
    expect(rows(page)).to_have_count(50)
    page.get_by_role("button", name="Older ones").click()
    expect(rows(page)).to_have_count(60)
    expect(page.get_by_role("button", name="Older ones")).to_have_count(0)


def test_it_fits_a_phone_and_can_be_read(gateway: RealGateway, worker: Worker, open_page: OpenPage) -> None:
    call = {"kind": "call_service", "request": {"service": f"/{worker.name}/" + "x" * 80, "type": TRIGGER}}
    gateway.ask("POST", f"/robots/{worker.name}/commands", call)
    gateway.ask("POST", f"/robots/{worker.name}/commands", {**call, "request": {"service": "/broken", "type": TRIGGER}})
    gateway.ask("POST", f"/robots/{worker.name}/commands", {"kind": "set_uplink", "request": {"bytes_per_s": None}})
    desktop = commands_of(gateway, open_page, worker.name)
    rows(desktop).first.locator("summary").click()
    faults = unreadable(desktop, "desktop", shot="commands-desktop")
    page = commands_of(gateway, open_page, worker.name, size=PHONE, touch=True)
    expect(rows(page)).to_have_count(3)
    rows(page).last.locator("summary").click()
    faults += unreadable(page, "phone", shot="commands-phone")
    form(page)
    assert faults + unreadable(page, "form", shot="commands-form-phone") == []
