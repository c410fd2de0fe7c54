"""The drive to the right, without network, clock and files: messages in, commands and records out."""
