"""The filter that follows a pose from message to message, and the parts that it has."""
