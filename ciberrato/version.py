"""The version of the distribution, in one place."""

__version__ = "1.0.0"
