"""Python one-liners that tests run as nodes. Each says `up` once it is ready for any signal."""

# Blocked before it says so: a SIGINT between that and the wait would be a KeyboardInterrupt.
SLEEP = (
    "import signal; signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT]); print('up', flush=True); "
    "signal.sigwait([signal.SIGINT])"
)
DEAF = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN); print('up', flush=True); signal.pause()"
