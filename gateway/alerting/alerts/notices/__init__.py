"""Notices: alerts sent to where people are, by webhook and e-mail."""
