"""Documents: one module each, readers and writers."""
