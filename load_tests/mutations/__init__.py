"""The faults of issue 23: one-line mutations, against which suites of tests are compared."""
