"""One module a campaign; `python -m load_tests.campaigns NAME` runs one."""
