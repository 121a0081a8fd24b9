"""What twins have to become, worked out from what people were answered: nobody looks into the database.

Edits are made at the same time; the store says in each answer which change it was, and that is the order here. What
was not answered did not happen: the gateway is asked again.
"""

from __future__ import annotations

from collections.abc import Mapping
from random import Random  # noqa: TID251 - the type of an argument
from typing import Any

from gateway.domain.errors import TwinChangedError, UnknownTemplateError
from gateway.domain.fleet.selector import Selector
from gateway.domain.fleet.twin import Template, effective, made_of
from gateway.fleet.twins.feature import Twins
from gateway.fleet.twins.manager import Editor
from gateway.fleet.twins.plan import Edit, Outcome
from metaros.fleet.twin import canonical, merge

__all__ = ["ADMIN", "SITES", "Model", "Step", "random_step"]

ADMIN = Editor(name="ada", code=True)
SITES = ("lab", "hall", "yard")
KINDS = {
    "patch": 12,
    "patch if unchanged": 4,
    "put": 1,
    "many": 3,
    "template": 3,
    "no template": 1,
    "label": 2,
    "again": 1,
}
SECTIONS = {"parameter": 10, "no parameter": 2, "budget": 2, "topic": 2, "node": 2, "agent": 1, "no section": 1}
Step = tuple[str, ...]


def random_step(rng: Random, robots: Mapping[str, str]) -> Step:
    """What somebody does: of one robot, of those of a site, or of a site's template."""
    kind = rng.choices(list(KINDS), list(KINDS.values()))[0]
    if kind in ("many", "template", "no template"):
        return kind, rng.choice(SITES)
    name = rng.choice(sorted(robots))
    return (kind, name, rng.choice(SITES)) if kind == "label" else (kind, name)


class Model:
    """`robots` are at the sites that they say in their Hello."""

    def __init__(self, robots: Mapping[str, str], rng: Random | None = None) -> None:
        """With a generator edits are of every section; else each sets a parameter of its own."""
        self.robots = dict(robots)
        self.edits = 0
        self.templates: dict[str, Template] = {}
        self._rng = rng
        self._own: dict[str, dict[int, tuple[str, Any]]] = {name: {} for name in robots}  # by change
        self._given: dict[str, dict[int, str]] = {name: {} for name in robots}

    def own(self, robot: str) -> dict[str, Any]:
        """The robot's own document."""
        found: dict[str, Any] = {}
        for _, (kind, value) in sorted(self._own[robot].items()):
            found = value if kind == "put" else merge(found, value)
        return found

    def document(self, robot: str) -> bytes:
        """The whole document of a robot."""
        given = self._given[robot]
        labels = {"site": given[max(given)] if given else self.robots[robot]}
        return canonical(effective(made_of(self.templates.values(), robot, labels), self.own(robot)))

    async def edit(self, twins: Twins, step: Step, *, window_s: float | None = None) -> None:
        """Do it, and remember what was answered."""
        self.edits += 1
        editor = Editor(name="ada", code=True, confirm_within_s=window_s)
        kind, what = step[0], step[1]
        if kind in ("template", "no template"):
            await self._edit_template(twins, kind, what, editor)
        elif kind == "many":
            patch = self._patch()
            selector = Selector.parse(f"site={what}")
            edit = Edit(patch=patch)
            for outcome in await twins.manager.edit_many(selector, edit, editor, sees=bool, dry_run=False):
                self._note(outcome, "patch", patch)
        elif kind == "label":
            edit = Edit(labels={"site": step[2]})
            outcome = await twins.manager.edit(what, edit, editor, dry_run=False)
            if outcome.changed:
                self._given[what][outcome.after.change] = step[2]
        else:
            await self._edit_one(twins, kind, what, editor)

    async def patch(self, twins: Twins, robot: str, patch: Mapping[str, Any]) -> None:
        """This very patch of a robot's own document."""
        self._note(await twins.manager.edit(robot, Edit(patch=patch), ADMIN, dry_run=False), "patch", patch)

    async def _edit_one(self, twins: Twins, kind: str, robot: str, editor: Editor) -> None:
        if kind == "again":
            await twins.manager.edit(robot, Edit(again=True), editor, dry_run=False)
            return
        value, expected = self._patch(), None
        if kind == "put":
            value = merge({}, value)
        if kind == "patch if unchanged":
            seen = (await twins.manager.state(robot)).desired
            expected = seen.revision, seen.edition
        edit = Edit(document=value) if kind == "put" else Edit(patch=value)
        try:
            outcome = await twins.manager.edit(robot, edit, editor, expected=expected, dry_run=False)
        except TwinChangedError:
            return
        self._note(outcome, kind, value)

    async def _edit_template(self, twins: Twins, kind: str, site: str, editor: Editor) -> None:
        """People who change one template do so one after the other: its name is in no two steps at once."""
        name = f"t-{site}"
        if kind == "template":
            part = merge({}, self._patch())
            selector = f"site={site}"
            item, _ = await twins.templates.put(
                name, selector=selector, document=part, priority=0, editor=editor, dry_run=False
            )
            self.templates[name] = item
            return
        try:
            await twins.templates.remove(name, editor=editor, dry_run=False)
        except UnknownTemplateError:
            assert name not in self.templates
            return
        del self.templates[name]

    def _note(self, outcome: Outcome, kind: str, value: Any) -> None:
        if outcome.changed:
            self._own[outcome.after.robot][outcome.after.change] = kind, value

    def _patch(self) -> dict[str, Any]:
        number, rng = self.edits, self._rng
        parameter = {"parameters": {f"n{number % 5}": {f"p{number}": number}}}
        if rng is None:
            return parameter
        match rng.choices(list(SECTIONS), list(SECTIONS.values()))[0]:
            case "no parameter":
                gone = rng.randrange(1, number + 1)
                return {"parameters": {f"n{gone % 5}": {f"p{gone}": None}}}
            case "budget":
                return {"budget": {"bytes_per_s": 20_000 + number}}
            case "topic":
                row = {"class": rng.choice(("live", "bulk", "event")), "rate_hz": float(number)}
                return {"topics": {f"t{number % 3}": row}}
            case "node":
                return {"nodes": {rng.choice(("x", "y")): {"allowed": "x", "nice": number % 20}}}
            case "agent":
                return {"agent": {"version": f"1.0.{number}"}}
            case "no section":
                return {rng.choice(("topics", "nodes", "budget", "agent")): None}
        return parameter
