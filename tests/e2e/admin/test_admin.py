"""The Admin page over a real gateway: robots enrolled by the command copied there, people, keys, the audit log."""

from __future__ import annotations

import json
import re
import shlex
import sqlite3
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Locator, Page, Route, expect

from tests.e2e.conftest import PHONE
from tests.e2e.readable import unreadable
from tests.e2e.real.gateway import real_stack, send
from tests.support.processes.command_line import Done, call_metaros
from tests.support.processes.stack import Stack
from tests.support.waiting import wait_until

pytestmark = [
    pytest.mark.browser,
    pytest.mark.integration,
    pytest.mark.xdist_group("browser"),
    pytest.mark.timeout(600),
]

OpenPage = Callable[..., Page]
PARTS = ("robots", "users", "keys", "audit")
LOOKS_AGAIN_MS = 10_000  # the page asks for users and keys so often
NEWEST_AGAIN_MS = 5000  # and for the newest rows of the log


def link(stack: Stack, name: str = "") -> str:
    """A sign-in link, by the key of the gateway's machine; for the first admin where no name is given."""
    answer = send(stack.url, "POST", "/auth/links", key=stack.key, json={"name": name})
    assert answer.status_code == 201, answer.text
    return str(answer.json()["url"])


def get(stack: Stack, path: str) -> Any:
    """What the API says to the machine's own key."""
    return send(stack.url, "GET", path, key=stack.key).json()


def add_user(stack: Stack, name: str, role: str) -> None:
    """Somebody who is there already."""
    answer = send(stack.url, "POST", "/users", key=stack.key, json={"name": name, "role": role})
    assert answer.status_code == 201, answer.text


def signed_in(stack: Stack, open_page: OpenPage, name: str = "", *, path: str = "/", **options: object) -> Page:
    """A page of somebody who came by a link."""
    page = open_page(stack.url + path, link=link(stack, name), **options)
    expect(page.locator(".who")).to_be_visible()
    return page


def copied(page: Page, name: str, *, clipboard: bool = True) -> str:
    """Press Copy; what the clipboard holds then. Without `clipboard` as on a page over plain http."""
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    if not clipboard:
        page.evaluate("() => { navigator.clipboard.writeText = () => Promise.reject(new Error('no')); }")
    field = page.locator(f"[data-copy={name}]")
    field.get_by_role("button", name="Copy").click()
    expect(field.get_by_role("button")).to_have_text("Copied ✓")
    text = str(page.evaluate("() => navigator.clipboard.readText()"))
    assert text == field.locator("code").inner_text()
    return text


def run(command: str) -> Done:
    """A command as somebody pastes it into a shell; in a thread, because Playwright's loop runs in this one."""
    words = shlex.split(command)
    assert words[0] == "metaros"
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(call_metaros, *words[1:]).result(120)


def answer_of(page: Page, title: str) -> Locator:
    """The open dialog of that title."""
    dialog = page.get_by_role("dialog", name=title)
    expect(dialog).to_be_visible()
    return dialog


@pytest.fixture
def stack(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Stack]:
    """A gateway of the test's own, and a home directory for the agent's identity."""
    monkeypatch.setenv("HOME", str(tmp_path))
    with real_stack(tmp_path) as running:
        yield running


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stack]:
    """A gateway for the tests that do not mind each other."""
    with real_stack(tmp_path_factory.mktemp("admin")) as running:
        yield running


def test_a_robot_is_enrolled_by_the_copied_command_and_revoked(stack: Stack, open_page: OpenPage) -> None:
    stack.router()
    page = signed_in(stack, open_page)
    page.get_by_role("link", name="Admin").click()
    expect(page.locator(".nothing")).to_contain_text("No robot is enrolled yet")
    page.get_by_label("Name of the robot").fill("arm_1")
    page.get_by_role("button", name="Make the command").click()
    expect(page.locator("[data-card=enrol] .note")).to_have_text(re.compile(r"good for (1:00:00|59:\d\d)"))
    expect(page.locator("[data-card=tokens] [data-token]")).to_contain_text("arm_1")
    command = copied(page, "enrol")
    assert f"--gateway {stack.url} --name arm_1" in command

    done = run(command)
    assert done.code == 0, done.err
    expect(page.locator(".enrol-done")).to_have_text("arm_1 is enrolled")
    expect(page.locator("[data-token]")).to_have_count(0)
    row = page.locator("[data-identity=arm_1]")
    expect(row).to_contain_text(re.compile(r"renews in .* ends in"))
    start = copied(page, "agent", clipboard=False)
    assert start == "metaros agent --name arm_1"
    robot = ("--namespace", "/arm_1", "--zenoh-port", str(stack.zenoh_port), "--no-host-metrics")
    agent = stack.start("agent", *shlex.split(start)[1:], *robot)
    expect(row).to_contain_text("online")
    expect(page.get_by_role("link", name="It is online")).to_be_visible()

    page.get_by_role("button", name="Revoke arm_1", exact=True).click()
    dialog = answer_of(page, "Revoke arm_1?")
    expect(dialog).to_contain_text("the link to it is cut within seconds")
    dialog.get_by_label("Reason").fill("lost on the way")
    dialog.get_by_role("button", name="Revoke", exact=True).click()
    expect(row).to_have_attribute("data-standing", "revoked")
    expect(row).to_contain_text("lost on the way")
    expect(row).to_contain_text("offline")
    wait_until(lambda: "arm_1" not in stack.online())
    wait_until(lambda: "certificate_revoked" in agent.output)
    row.get_by_role("button", name="Enrol arm_1 again").click()
    expect(page.get_by_label("Name of the robot")).to_have_value("arm_1")


def test_a_withdrawn_command_enrols_nobody(shared: Stack, open_page: OpenPage, tmp_path: Path) -> None:
    page = signed_in(shared, open_page, path="/admin/robots")
    page.get_by_label("Name of the robot").fill("no such/name")
    page.get_by_role("button", name="Make the command").click()
    expect(page.get_by_role("alert")).to_contain_text("a robot id is")
    page.get_by_label("Name of the robot").fill("late_1")
    page.get_by_role("button", name="1 day").click()
    page.get_by_role("button", name="Make the command").click()
    command = copied(page, "enrol")
    page.get_by_role("button", name="Withdraw the command for late_1").click()
    answer_of(page, "Withdraw this command?").get_by_role("button", name="Withdraw").click()
    expect(page.locator("[data-token]", has_text="late_1")).to_have_count(0)
    done = run(f"{command} --state-dir {shlex.quote(str(tmp_path))}")
    assert done.code != 0
    assert "token_unknown" in done.err


def test_an_alarm_stands_first_and_says_what_to_do(stack: Stack, open_page: OpenPage) -> None:
    for name in ("arm_1", "arm_2"):
        order = {"robot": name}
        made = send(stack.url, "POST", "/enrolment-tokens", key=stack.key, json=order)
        where = shlex.quote(str(stack.folder / name))
        assert run(f"{made.json()['command']} --state-dir {where}").code == 0
        if name == "arm_2":  # the same token with another key: a copy of the command was used elsewhere
            other = shlex.quote(str(stack.folder / "copy"))
            assert run(f"{made.json()['command']} --state-dir {other}").code != 0
    page = signed_in(stack, open_page, path="/admin/robots")
    alarm = page.locator("[data-alarm]")
    expect(alarm).to_have_count(1)
    expect(alarm.get_by_role("alert")).to_have_text("arm_2: its enrolment token was tried again, with another key")
    expect(page.locator("[data-identity]").first).to_have_attribute("data-identity", "arm_2")
    alarm.get_by_role("button", name="Revoke arm_2").click()
    answer_of(page, "Revoke arm_2?").get_by_role("button", name="Revoke", exact=True).click()
    expect(alarm).to_have_count(0)


def test_a_user_is_added_signs_in_by_the_link_is_changed_and_cut(shared: Stack, open_page: OpenPage) -> None:
    page = signed_in(shared, open_page, path="/admin/users", clock=True)
    page.get_by_role("button", name="Add a user").click()
    dialog = answer_of(page, "Add a user")
    dialog.get_by_label("Name").fill("Bob")
    dialog.get_by_role("button", name="Add", exact=True).click()
    expect(dialog.get_by_role("alert")).to_contain_text("Lower-case letters")
    dialog.get_by_label("Name").fill("bob")
    dialog.get_by_label("Robots", exact=True).fill("arm_* sim_1")
    dialog.get_by_role("button", name="Add", exact=True).click()
    answer_of(page, "Sign-in link for bob")
    address = copied(page, "link")
    page.get_by_role("button", name="Done").click()
    row = page.locator("[data-user=bob]")
    expect(row).to_contain_text("arm_*, sim_1")
    expect(row).to_contain_text("never")

    theirs = open_page(address)
    expect(theirs.locator(".who")).to_contain_text("bob")
    wait_until(lambda: [one["signed_in"] for one in get(shared, "/users")["users"] if one["name"] == "bob"] != [None])
    page.clock.fast_forward(LOOKS_AGAIN_MS)
    expect(row).to_contain_text(re.compile(r"\d+ s ago"))
    row.get_by_role("button", name="Change bob").click()
    dialog = answer_of(page, "Change bob")
    dialog.get_by_role("radio", name="operator").check()
    dialog.get_by_role("button", name="Save").click()
    expect(row).to_contain_text("operator")
    theirs.reload()
    expect(theirs.locator(".who")).to_contain_text("operator")

    row.get_by_role("button", name="Disable bob").click()
    answer_of(page, "Disable bob?").get_by_role("button", name="Disable").click()
    expect(row).to_have_attribute("data-disabled", "true")
    expect(theirs.locator(".who")).to_have_count(0)
    row.get_by_role("button", name="Enable bob").click()
    expect(row).to_have_attribute("data-disabled", "false")
    row.get_by_role("button", name="Delete bob").click()
    answer_of(page, "Delete bob?").get_by_role("button", name="Delete").click()
    expect(row).to_have_count(0)


def test_the_last_admin_stays_and_the_page_says_why(shared: Stack, open_page: OpenPage) -> None:
    page = signed_in(shared, open_page, path="/admin/users")
    page.get_by_role("button", name="Delete admin").click()
    dialog = answer_of(page, "Delete admin?")
    dialog.get_by_role("button", name="Delete").click()
    expect(dialog.get_by_role("alert")).to_contain_text("admin is the last admin: make another one first")
    page.keyboard.press("Escape")
    expect(dialog).to_have_count(0)
    expect(page.locator("[data-user=admin]")).to_be_visible()
    expect(page.get_by_role("button", name="Delete admin")).to_be_focused()


def test_a_key_of_the_page_works_until_it_is_revoked(shared: Stack, open_page: OpenPage) -> None:
    page = signed_in(shared, open_page, path="/admin/keys", clock=True)
    page.get_by_role("button", name="Make a key").click()
    dialog = answer_of(page, "Make a key")
    dialog.get_by_label("Name").fill("wall display")
    dialog.get_by_role("radio", name="operator").check()
    dialog.get_by_role("checkbox").check()
    dialog.get_by_role("button", name="30 days").click()
    dialog.get_by_role("button", name="Make the key").click()
    key = copied(page, "key")
    secret = copied(page, "key-secret")
    assert key.endswith(f"_{secret}")
    page.get_by_role("button", name="I have kept it").click()
    expect(page.locator("dialog")).to_have_count(0)  # gone from the page: one that closes has no role any more
    assert secret not in page.content(), "shown once"
    row = page.locator("[data-key]", has_text="wall display")
    expect(row).to_contain_text("in 30")
    expect(row).to_contain_text("lambda")
    expect(row).to_contain_text("never")

    who = send(shared.url, "GET", "/auth/me", key=key).json()
    assert (who["kind"], who["role"], who["scopes"]) == ("key", "operator", ["lambda"])
    wait_until(lambda: all(one["used"] for one in get(shared, "/keys")["keys"] if one["name"] == "wall display"))
    page.clock.fast_forward(LOOKS_AGAIN_MS)
    expect(row).not_to_contain_text("never")
    page.get_by_role("button", name="Revoke the key wall display").click()
    answer_of(page, "Revoke the key wall display?").get_by_role("button", name="Revoke").click()
    expect(row).to_have_count(0)
    assert send(shared.url, "GET", "/auth/me", key=key).status_code == 401


@pytest.mark.parametrize("role", ["viewer", "operator"])
def test_who_is_no_admin_has_keys_alone_and_is_reported_why(shared: Stack, open_page: OpenPage, role: str) -> None:
    name = f"only-{role}"
    add_user(shared, name, role)
    page = signed_in(shared, open_page, name)
    expect(page.get_by_role("link", name="Recordings")).to_be_visible()
    expect(page.get_by_role("link", name="Admin")).to_have_count(0)
    for path in ("/admin", "/admin/robots", "/admin/users", "/admin/audit"):
        page.goto(shared.url + path)
        expect(page.locator("[data-refused=role]")).to_contain_text(f"{name}, whose role is {role}")
    page.get_by_role("link", name="My keys").click()
    expect(page.locator("h1")).to_have_text("My keys")
    page.get_by_role("button", name="Make a key").click()
    dialog = answer_of(page, "Make a key")
    expect(dialog.get_by_role("radio", name="admin")).to_have_count(0)
    dialog.get_by_label("Name").fill(f"script of a {role}")
    dialog.get_by_role("button", name="Make the key").click()
    page.get_by_role("button", name="I have kept it").click()
    expect(page.locator("[data-key]")).to_have_count(1)


def test_who_has_not_signed_in_is_asked_to(shared: Stack, open_page: OpenPage) -> None:
    page = open_page(f"{shared.url}/admin/audit")
    expect(page.locator("[data-refused=sign-in]")).to_contain_text("Sign in first")
    page.locator("main").get_by_role("link", name="Sign in").click()
    expect(page).to_have_url(re.compile(r"/signin\?back=%2Fadmin%2Faudit$"))


def test_the_log_shows_what_happened_is_proven_and_a_changed_row_is_named(stack: Stack, open_page: OpenPage) -> None:
    page = signed_in(stack, open_page)
    for number in range(120):
        add_user(stack, f"user-{number}", "viewer")
    refused = send(stack.url, "DELETE", "/users/user-7", key="")
    assert refused.status_code == 401
    long = "x" * 64
    assert send(stack.url, "DELETE", f"/users/{long}", key=stack.key).status_code == 404

    page.goto(f"{stack.url}/admin/audit")
    rows = page.locator("[data-row]")
    expect(rows.first).to_contain_text(f"tried to delete user {long}")
    expect(rows.first).to_have_attribute("data-outcome", "failed")
    expect(rows.nth(1)).to_have_attribute("data-outcome", "refused")
    expect(rows.nth(1)).to_contain_text("somebody unknown tried to delete user user-7")
    rows.nth(2).locator("summary").click()
    expect(rows.nth(2)).to_contain_text("POST /api/v1/users")
    rows.last.scroll_into_view_if_needed()  # Chromium drops the key End where it has yet to draw what was opened
    expect(page.locator("[data-row='1']")).to_be_visible()
    assert rows.evaluate_all("all => all.map(row => Number(row.dataset.row))") == list(range(rows.count(), 0, -1))
    expect(page.locator("[data-row='2']")).to_contain_text("admin signed in by a link")

    page.get_by_label("About").select_option("sessions.open")
    expect(rows).to_have_count(1)
    expect(page).to_have_url(re.compile(r"action=sessions\.open"))
    page.get_by_label("About").select_option("")
    page.get_by_label("By whom").fill("nobody-of-that-name")
    page.get_by_label("By whom").press("Enter")
    expect(page.locator(".nothing")).to_contain_text("Nothing in the log fits")
    page.goto(f"{stack.url}/admin/audit")

    page.get_by_role("button", name="Verify the log").click()
    expect(page.locator("[data-proof=good]")).to_contain_text(f"The log is whole: {len_of(stack)} rows")
    change_row(stack, 5)
    page.get_by_role("button", name="Verify the log").click()
    bad = page.locator("[data-proof=bad]")
    expect(bad).to_contain_text("The log was changed after it was written: see row 5.")
    bad.get_by_role("button", name="Row 5").click()
    expect(rows.first).to_have_attribute("data-row", "5")
    expect(rows.first).to_contain_text("does not hold")
    page.get_by_role("button", name="Show the newest").click()
    expect(rows.first).not_to_have_attribute("data-row", "5")


def test_that_older_rows_did_not_come_is_said_until_they_are_asked_for_again(
    shared: Stack, open_page: OpenPage
) -> None:
    page = signed_in(shared, open_page, clock=True)
    for _ in range(3):
        assert send(shared.url, "POST", "/auth/tickets", key=shared.key, json={}).status_code == 201
    broken = [True]

    def two_at_a_time(route: Route) -> None:
        if "before=" in route.request.url and broken:
            problem = {"code": "store_error", "detail": "the disk is away"}
            route.fulfill(status=503, content_type="application/problem+json", body=json.dumps(problem))
        else:
            route.continue_(url=route.request.url.replace("limit=100", "limit=2"))

    page.route("**/api/v1/audit?*", two_at_a_time)
    page.goto(f"{shared.url}/admin/audit")
    rows, said = page.locator("[data-row]"), page.locator(".audit-end").get_by_role("alert")
    expect(rows).to_have_count(2)
    expect(said).to_contain_text("the disk is away")
    expect(rows.nth(1)).to_contain_text("made a ticket for a viewer")
    send(shared.url, "POST", "/auth/tickets", key=shared.key, json={})
    page.clock.fast_forward(NEWEST_AGAIN_MS)
    expect(rows).to_have_count(3)
    expect(said).to_contain_text("the disk is away")
    broken.clear()
    page.get_by_role("button", name="Older rows").click()
    expect(said).to_have_count(0)
    expect(rows.nth(3)).to_be_visible()  # older than the three


def len_of(stack: Stack) -> int:
    """How many rows the log has."""
    with closing(sqlite3.connect(stack.folder / "data" / "gateway.sqlite", timeout=60)) as database:
        return int(database.execute("SELECT count(*) FROM audit").fetchone()[0])


def change_row(stack: Stack, number: int) -> None:
    """What somebody does who owns the database and has something to hide."""
    with closing(sqlite3.connect(stack.folder / "data" / "gateway.sqlite", timeout=60)) as database, database:
        found = database.execute("SELECT name FROM sqlite_master WHERE type = 'trigger' AND tbl_name = 'audit'")
        for (trigger,) in found.fetchall():
            database.execute(f"DROP TRIGGER {trigger}")
        changed = database.execute("UPDATE audit SET name = 'eve' WHERE number = ?", (number,))
        assert changed.rowcount == 1


def test_every_part_fits_a_phone_and_can_be_read(shared: Stack, open_page: OpenPage) -> None:
    send(shared.url, "POST", "/keys", key=shared.key, json={"name": "k" * 64, "role": "viewer"})
    page = signed_in(shared, open_page, size=PHONE, touch=True)
    faults = []
    for part in PARTS:
        page.goto(f"{shared.url}/admin/{part}")
        expect(page.locator(".admin :is(table, ol, .nothing)").first).to_be_visible()
        faults += unreadable(page, part, shot=f"admin-{part}", whole=True)
    assert faults == []
