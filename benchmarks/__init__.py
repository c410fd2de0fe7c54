"""Speed and accuracy, measured; `python -m benchmarks` prints a table."""
