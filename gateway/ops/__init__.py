"""Operations: what the gateway says of itself in metrics, traces, logs and a report."""
