"""The live view: a CiberRato viewer client on one side, a web page on the other."""

__all__ = [
    "cli",
    "connection",
    "outbox",
    "overlay_store",
    "page_messages",
    "recording",
    "server",
    "session",
    "site",
    "timeline",
    "world",
]
