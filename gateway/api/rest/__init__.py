"""REST under /api/v1: one module for each noun, one package for each subject.

A new route is a function with `dependencies=[require_permission("noun.verb")]` in its noun's module: the permission is
a row of `gateway.identity.permissions`, the answer's shape a model of `gateway.api.models`, the feature that it calls a
field of `gateway.api.services`; a new module's router joins the list in `gateway.api`. Then `make proto` generates the
dashboard's client anew, and docs/reference/rest.md gets its line; tests check both.
"""
