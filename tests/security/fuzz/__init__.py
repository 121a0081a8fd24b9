"""The targets of the fuzzers, by where their bytes come from."""
