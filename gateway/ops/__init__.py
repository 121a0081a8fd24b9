"""Operations: the gateway's metrics, traces, logs and process report."""
