"""Watching: what is committed and what is known of links, judged once a second; identical again after a kill -9."""
