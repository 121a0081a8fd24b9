"""The errors of twins, templates and selectors; `gateway.errors` has the tree they belong to.

    RequestError
    ├── SelectorError           a selector or a label breaks the grammar            selector_invalid
    ├── UnknownTemplateError    there is no such template                           unknown_template
    ├── UnknownRevisionError    the revision of a twin is not kept, or never was    unknown_revision
    └── TwinChangedError        somebody else was faster than this edit             twin_changed
"""

from __future__ import annotations

from gateway.errors import RequestError

__all__ = ["SelectorError", "TwinChangedError", "UnknownRevisionError", "UnknownTemplateError"]


class UnknownTemplateError(RequestError):
    """There is no such template."""

    code = "unknown_template"


class UnknownRevisionError(RequestError):
    """The revision of a twin is not kept any more, or never was."""

    code = "unknown_revision"


class SelectorError(RequestError):
    """A selector or a label breaks the grammar; the message says where."""

    code = "selector_invalid"


class TwinChangedError(RequestError):
    """The twin or template is not at the revision that If-Match names: somebody else was faster."""

    code = "twin_changed"
