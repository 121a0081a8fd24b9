"""The topics tab in a real browser: rates, the raw message, forms made from the types, publishing and calling."""

from __future__ import annotations

import re
from collections.abc import Callable
from urllib.parse import parse_qs, urlsplit

import pytest
from playwright.sync_api import Locator, Page, Route, expect

from gateway.domain.principal import Role
from tests.e2e.conftest import DESKTOP, PHONE
from tests.e2e.fake.gateway import FakeGateway, account
from tests.e2e.readable import save, unreadable
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.browser, pytest.mark.xdist_group("browser")]

OpenPage = Callable[..., Page]


def opened(gateway: FakeGateway, open_page: OpenPage, query: str = "", **options: object) -> Page:
    page = open_page(f"{gateway.url}/robots/sim_1?tab=topics{query}", **options)
    expect(page.locator("tr[data-topic]")).to_have_count(8)
    return page


def row(page: Page, name: str) -> Locator:
    return page.locator(f"tr[data-topic='/sim_1/{name}']")


def test_a_row_tells_rate_bandwidth_type_qos_and_class(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = opened(gateway, open_page)
    scan = row(page, "scan")
    for said in ("LaserScan", "10.0\u202fHz", "900\u202fB/s", "best effort · keep last 5", "live", "1 → 0"):
        expect(scan).to_contain_text(said)
    expect(row(page, "battery_state")).to_contain_text("reliable · keep last 10")
    expect(scan.locator(".spark polyline")).to_be_attached()
    page.get_by_role("searchbox").fill("imu")
    expect(page.locator("tr[data-topic]")).to_have_count(1)


def test_the_raw_message_changes_in_place(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = opened(gateway, open_page)
    row(page, "odom").get_by_role("button", name="odom").click()
    expect(page).to_have_url(re.compile(r"topic=%2Fsim_1%2Fodom"))
    x = page.locator("[data-path='pose.pose.position.x'] .message-value")
    expect(x).to_have_text(re.compile(r"^-?\d"))
    first = x.text_content() or ""
    x.evaluate("element => { element.kept = true }")
    expect(x).not_to_have_text(first)
    assert x.evaluate("element => element.kept") is True, "the row is the same one"
    covariance = page.locator("[data-path='pose.covariance']")
    expect(covariance).to_contain_text("36 items")
    covariance.get_by_role("button").click()
    expect(page.locator("[data-path='pose.covariance.35']")).to_have_text("350")
    page.locator("[data-path='pose']").get_by_role("button").click()
    expect(page.locator("[data-path='pose.covariance.35']")).to_have_count(0)
    page.get_by_role("button", name="Pause").click()
    still = page.locator("[data-path='header.stamp']").text_content()
    line = row(page, "imu").locator(".spark polyline")
    before = line.get_attribute("points")
    expect(line).not_to_have_attribute("points", before or "")  # two seconds have gone by
    expect(page.locator("[data-path='header.stamp']")).to_have_text(still or "?")


def test_a_message_is_filled_in_as_its_type_says_and_published(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = opened(gateway, open_page, "&topic=/sim_1/motor_temperature&view=publish")
    form = page.locator(".message-form")
    form.locator("[data-field=temperature]").get_by_role("textbox").fill("41.5")
    form.locator("[data-field='header.frame_id']").get_by_role("textbox").fill("motor <b>")
    sec = form.locator("[data-field='header.stamp.sec']")
    sec.get_by_role("textbox").fill("1.5")
    expect(sec).to_contain_text("without a point")
    expect(form.get_by_role("button", name="Publish")).to_be_disabled()
    sec.get_by_role("textbox").fill("7")
    form.get_by_role("button", name="JSON").click()
    text = form.get_by_role("textbox")
    expect(text).to_have_value(re.compile(r'"frame_id": "motor <b>"'))
    text.fill((text.input_value()).replace('"sec": 7', '"sec": 8'))
    form.get_by_role("button", name="Form").click()
    expect(sec.get_by_role("textbox")).to_have_value("8")
    form.get_by_role("button", name="Publish").click()
    expect(form.get_by_role("status")).to_contain_text("1 published")
    (said,) = gateway.graph.published
    header = {"stamp": {"sec": 8, "nanosec": 0}, "frame_id": "motor <b>"}
    assert said["message"] == {"header": header, "temperature": 41.5, "variance": 0.0}
    assert (said["topic"], said["type"]) == ("/sim_1/motor_temperature", "sensor_msgs/msg/Temperature")


def test_lists_have_their_length(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = opened(gateway, open_page, "&topic=/sim_1/imu&view=publish")
    field = page.locator("[data-field='orientation_covariance']")
    expect(field).to_contain_text("float64[9]")
    field.get_by_role("textbox").fill("1, 2")
    expect(field).to_contain_text("2 of 9 values")
    expect(page.get_by_role("button", name="Publish", exact=True).last).to_be_disabled()


def test_what_moves_the_robot_is_not_published_from_here(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = opened(gateway, open_page, "&topic=/sim_1/cmd_vel&view=publish")
    expect(page.locator(".topic-view")).to_contain_text("drive pad")
    expect(page.locator(".message-form")).to_have_count(0)


def test_a_service_is_called_with_a_form_and_answers(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = opened(gateway, open_page)
    services = page.locator(".services")
    expect(services.locator("[data-service]")).to_have_count(2)
    services.get_by_label("parameter services too").check()
    expect(services.locator("[data-service]")).to_have_count(3)
    services.get_by_role("button", name="base/set_light").click()
    services.get_by_role("switch").check()
    services.get_by_role("button", name="Call").click()
    expect(services.get_by_label("Answer")).to_contain_text('"success": true')
    (called,) = gateway.called
    assert (called["service"], called["type"]) == ("/sim_1/base/set_light", "std_srvs/srv/SetBool")
    assert called["request"] == {"data": True}


def test_a_goal_is_begun_followed_and_cancelled(gateway: FakeGateway, open_page: OpenPage) -> None:
    gateway.graph.actions.append(("count", "example_interfaces/action/Fibonacci"))
    page = opened(gateway, open_page)
    page.get_by_role("button", name="count", exact=True).click()
    form = page.locator("[data-goal]")
    form.locator("[data-field=order]").get_by_role("textbox").fill("5")
    form.get_by_role("button", name="Send goal").click()
    status = form.locator(".goal-line")
    expect(status).to_contain_text("accepted")
    (begun,) = gateway.graph.goals
    assert (begun["action"], begun["goal"]) == ("/sim_1/count", {"order": 5})
    reported = gateway.graph.goal_events
    reported.append(("status", {"status": "executing"}))
    reported.append(("feedback", {"status": "executing", "feedback": {"sequence": [0, 1, 1]}}))
    expect(form.get_by_label("Feedback")).to_contain_text('"sequence"')
    expect(status).to_contain_text("executing · 1 message of feedback")
    expect(form.get_by_role("button", name="Under way")).to_be_disabled()
    save(page, "goal", whole=True)
    form.get_by_role("button", name="Cancel goal").click()
    wait_until(lambda: gateway.graph.cancelled == ["ab" * 16])
    reported.append(("result", {"status": "canceled", "result": {"sequence": [0, 1, 1, 2]}}))
    expect(form.get_by_label("Result")).to_contain_text("2")
    expect(status).to_contain_text("canceled")
    expect(form.get_by_role("button", name="Send goal")).to_be_enabled()
    save(page, "goal-over", whole=True)
    gateway.graph.goals_known = False
    form.get_by_role("button", name="Send goal").click()
    expect(status).to_contain_text("lost · the gateway does not know of it any more")


def test_a_goal_that_is_sent_again_for_want_of_an_answer_is_the_same_one(
    gateway: FakeGateway, open_page: OpenPage
) -> None:
    gateway.graph.actions.append(("count", "example_interfaces/action/Fibonacci"))
    gateway.graph.goal_events.append(("result", {"status": "succeeded", "result": {"sequence": [0]}}))
    page = opened(gateway, open_page, "&action=/sim_1/count", own=True)
    keys: list[str] = []
    lost = [True, True, False, False]  # the answer's fate

    def carry(route: Route) -> None:
        keys.append(route.request.headers["idempotency-key"])
        answer = route.fetch()
        route.abort() if lost.pop(0) else route.fulfill(response=answer)

    page.route("**/actions/**", carry)
    form = page.locator("[data-goal]")
    button = form.get_by_role("button", name="Send goal")
    button.click()
    expect(form.get_by_role("alert")).to_contain_text("does not answer")
    form.locator("[data-field=order]").get_by_role("textbox").fill("5")
    button.click()
    wait_until(lambda: len(keys) == 2)
    expect(button).to_be_enabled()
    button.click()
    expect(form.locator(".goal-line")).to_contain_text("succeeded")
    second = "new MouseEvent('click', { detail: 2, bubbles: true, cancelable: true })"
    assert button.evaluate(f"button => button.dispatchEvent({second})") is False, "a double click is one click"
    button.click()
    wait_until(lambda: len(keys) == 4)
    first, changed, again, another = keys
    assert changed == again
    assert len({first, changed, another}) == 3
    page.unroute_all(behavior="wait")


def test_the_ends_and_the_type_are_reported(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = opened(gateway, open_page, "&topic=/sim_1/scan&view=ends")
    view = page.locator(".topic-view")
    for said in ("planner", "mapper", "best effort", "none of it"):
        expect(view).to_contain_text(said)
    page.get_by_role("button", name="Type", exact=True).click()
    expect(view).to_contain_text("float32 angle_increment")


def test_an_older_agent_that_tells_no_graph_can_be_called_all_the_same(
    gateway: FakeGateway, open_page: OpenPage
) -> None:
    gateway.graph.known = False
    page = opened(gateway, open_page)
    services = page.locator(".services")
    services.get_by_label("Service").fill("/sim_1/base/resume")
    services.get_by_label("Type").fill("std_srvs/srv/Trigger")
    services.get_by_role("button", name="Fill in…").click()
    expect(services.locator(".message-form")).to_contain_text("Nothing to fill in")
    services.get_by_role("button", name="Call").click()
    wait_until(lambda: [each["service"] for each in gateway.called] == ["/sim_1/base/resume"])


def test_a_viewer_reads_and_neither_publishes_nor_calls(gateway: FakeGateway, open_page: OpenPage) -> None:
    gateway.account = account(Role.VIEWER, name="vic")
    page = opened(gateway, open_page, "&topic=/sim_1/note&view=publish&service=/sim_1/base/resume")
    expect(page.locator("[data-may-not]")).to_have_count(2)
    page.get_by_role("button", name="Message").click()
    expect(page.locator("[data-path=data]")).to_contain_text("all well")


def test_the_way_into_foxglove_carries_a_ticket_for_this_robot(gateway: FakeGateway, open_page: OpenPage) -> None:
    page = opened(gateway, open_page)
    page.get_by_role("button", name="Open in Foxglove…").click()
    dialog = page.get_by_role("dialog")
    address = f"ws://127.0.0.1:{gateway.port}/foxglove/sim_1?token=mrt_1"
    expect(dialog.get_by_role("textbox", name="Address for viewers")).to_have_text(address)
    link = dialog.get_by_role("link", name="Open app.foxglove.dev").get_attribute("href") or ""
    assert parse_qs(urlsplit(link).query) == {"ds": ["foxglove-websocket"], "ds.url": [address]}
    dialog.get_by_role("button", name="Look, publish and call").click()
    expect(dialog.get_by_role("textbox", name="Address for viewers")).to_contain_text("mrt_2")
    assert [(each["robots"], each["role"]) for each in gateway.graph.tickets] == [
        (["sim_1"], "viewer"),
        (["sim_1"], "operator"),
    ]
    assert unreadable(page, shot="topics-foxglove") == []


def test_it_fits_a_phone_and_can_be_read(gateway: FakeGateway, open_page: OpenPage) -> None:
    faults = []
    for size, touch, word in ((DESKTOP, False, "desktop"), (PHONE, True, "phone")):
        query = "&topic=/sim_1/odom&service=/sim_1/base/set_light"
        page = opened(gateway, open_page, query, size=size, touch=touch)
        expect(page.locator("[data-path='pose.pose.position.x']")).to_be_visible()
        expect(page.get_by_role("switch")).to_be_visible()
        faults += unreadable(page, word, shot=f"topics-{word}", whole=True)
        page.get_by_role("button", name="Publish", exact=True).click()
        expect(page.locator("[data-field='pose.pose.position.x']")).to_be_visible()
        faults += unreadable(page, f"{word}, publishing", shot=f"topics-publish-{word}", whole=True)
    assert faults == []
