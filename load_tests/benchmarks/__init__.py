"""One module a benchmark, by what it measures; `python -m load_tests NAME` runs one."""
