"""Where to go: deciders that turn what the pose filter knows into motor commands, one policy a file."""
