"""Plans changes of robots' desired states: computed inside a transaction, checked as a whole, then stored or not.

Robots that share templates and an own document share the work: a document is merged and checked once.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from gateway.domain.errors import SelectorError
from gateway.domain.fleet.selector import MAX_LABELS
from gateway.domain.fleet.twin import CONFIRM_S, Desired, Template, changes_code, effective, made_of
from gateway.errors import UnknownRobotError
from gateway.store.engine import StoreEngine
from gateway.store.fleet.templates import read_templates
from gateway.store.fleet.twins import read_labels, read_twins
from metaros.fleet.twin import Change, TwinError, canonical, diff, digest, merge, parse, parse_part, read

__all__ = ["Author", "Edit", "Outcome", "Plan", "labels_of", "refusal"]

MAX_REVISION = (1 << 53) - 2  # what JSON in a browser can count to
SHOWN_ROBOTS = 3  # that a refusal names


@dataclass(frozen=True, slots=True, kw_only=True)
class Author:
    """Who changes something, when, why; and how long robots have to confirm it, None for as long as before."""

    name: str
    at_ns: int
    reason: str = ""
    confirm_within_s: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Edit:
    """What is to change of one robot's own things. None: stays."""

    patch: Mapping[str, Any] | None = None  # laid over its own document
    document: Mapping[str, Any] | None = None  # instead of it
    labels: Mapping[str, str | None] | None = None  # laid over its labels
    above: int = -1  # the revision gets past this one, whatever else changes
    again: bool = False  # a new revision of the same document


@dataclass(frozen=True, slots=True)
class Outcome:
    """One robot before and after; `error` says why the templates and its own document cannot become one."""

    before: Desired
    after: Desired
    error: TwinError | None = None

    @property
    def changed(self) -> bool:
        """Whether anything of it is to be stored."""
        return self.before is not self.after

    @property
    def changes(self) -> list[Change]:
        """What differs in the effective document."""
        if self.before.document == self.after.document:
            return []
        return diff(read(self.before.document), read(self.after.document))

    @property
    def own_changes(self) -> list[Change]:
        """What differs in the robot's own document."""
        return [] if self.before.own == self.after.own else diff(read(self.before.own), read(self.after.own))

    @property
    def code(self) -> str:
        """The path by which the robot would run other code; "" for none."""
        if self.error is not None:  # it comes into force once the document can be made again, whoever brings that about
            sections = {change.path.split("/")[1] for change in self.own_changes}
            return next((name for name in ("nodes", "agent") if name in sections), "")
        if self.before.document == self.after.document:
            return ""
        return changes_code(read(self.before.document), read(self.after.document))


def labels_of(said: Mapping[str, str], desired: Desired | None) -> dict[str, str]:
    """A robot's labels: what it said in its Hello, and over it what people gave it."""
    return {**said, **(desired.labels if desired is not None else {})}


class Plan:
    """The state of things in one transaction, and what edits make of it."""

    def __init__(self, engine: StoreEngine, robots: Collection[str] | None, seen_revisions: Mapping[str, int]) -> None:
        """Read the twins of some robots, or of every one. `seen_revisions`: the newest revision a robot has seen."""
        self._seen_revisions = seen_revisions
        self.said = read_labels(engine, robots)
        self.twins = read_twins(engine, robots)
        self.templates = read_templates(engine)
        self._wholes: dict[tuple[tuple[str, ...], bytes, bytes], tuple[bytes, bytes] | TwinError] = {}
        self._owns: dict[tuple[bytes, int], tuple[Edit, bytes]] = {}

    def labels(self, robot: str) -> dict[str, str]:
        """The robot's labels, as they are stored."""
        return labels_of(self.said.get(robot, {}), self.twins.get(robot))

    def require(self, robot: str) -> Desired:
        """The robot's desired state; UnknownRobotError for one that never connected."""
        if robot not in self.said:
            raise UnknownRobotError.of(robot)
        return self.twins.get(robot) or Desired(robot=robot, sha256=digest(b"{}"))

    def outcomes(
        self, robots: Iterable[str], edit: Callable[[str], Edit] | Edit, author: Author, *, change: int
    ) -> list[Outcome]:
        """What each robot becomes with its edit."""
        return [
            self._outcome(robot, edit if isinstance(edit, Edit) else edit(robot), author, change) for robot in robots
        ]

    def _outcome(self, robot: str, edit: Edit, author: Author, change: int) -> Outcome:
        before = self.require(robot)
        own = self._own(before, edit)
        given = merge(dict(before.labels), edit.labels) if edit.labels else before.labels
        if len(given) > max(MAX_LABELS, len(before.labels)):
            raise SelectorError(
                f"{robot}: a robot is given at most {MAX_LABELS} labels, and this would be {len(given)}"
            )
        named = made_of(self.templates.values(), robot, {**self.said[robot], **given})
        marks = tuple(item.mark for item in named)
        whole = self._whole(named, marks, own, before.own)
        error = whole if isinstance(whole, TwinError) else None
        document, sha256 = (before.document, before.sha256) if isinstance(whole, TwinError) else whole
        problem = str(error)[:1000] if error is not None else ""
        revision = before.revision
        if document != before.document or edit.again or edit.above >= revision:
            revision = min(max(revision, edit.above, self._seen_revisions.get(robot, 0)) + 1, MAX_REVISION)
        after = replace(
            before,
            revision=revision,
            own=own,
            document=document,
            sha256=sha256,
            labels=given,
            templates=marks,
            problem=problem,
        )
        if after == before:
            return Outcome(before, before, error)
        return Outcome(before, _signed(after, before, author, change), error)

    def _own(self, before: Desired, edit: Edit) -> bytes:
        """The own document after the edit, canonical and checked as the part that it is."""
        if edit.patch is None and edit.document is None:
            return before.own
        key = (before.own, id(edit))  # one edit of many robots is one object
        found = self._owns.get(key)
        if found is None:
            wanted = edit.document if edit.document is not None else merge(read(before.own), edit.patch)
            found = self._owns[key] = edit, canonical(parse_part(wanted))  # kept with it: its id stays its own
        return found[1]

    def _whole(
        self, named: list[Template], marks: tuple[str, ...], own: bytes, before: bytes
    ) -> tuple[bytes, bytes] | TwinError:
        found = self._wholes.get((marks, own, before))
        if found is None:
            try:
                data = parse(effective(named, read(own), before=read(before))).canonical
                found = data, digest(data)
            except TwinError as error:
                found = error
            self._wholes[marks, own, before] = found
        return found


def _signed(after: Desired, before: Desired, author: Author, change: int) -> Desired:
    window = author.confirm_within_s
    if window is None:
        window = before.confirm_within_s if before.edition else CONFIRM_S
    return replace(
        after,
        edition=before.edition + 1,
        change=change,
        author=author.name,
        at_ns=author.at_ns,
        reason=author.reason,
        confirm_within_s=window,
    )


def refusal(outcomes: Iterable[Outcome], *, strict: bool = False) -> TwinError | None:
    """Why a change cannot be: the robots that it would break; only if `strict` those that were broken before."""
    broken = [item for item in outcomes if item.error is not None and (strict or not item.before.problem)]
    if not broken:
        return None
    first = broken[0].error
    assert first is not None
    names = ", ".join(item.before.robot for item in broken[:SHOWN_ROBOTS])
    more = f" and {len(broken) - SHOWN_ROBOTS} more" if len(broken) > SHOWN_ROBOTS else ""
    return TwinError(first.path, f"{first.text} (robot {names}{more})")
