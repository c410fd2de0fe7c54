"""The agent: drives a robot from left to right through a known lab and works out in which cell it began.

Its rooms, each of which imports only from those before it:

- `agent.drives.right`: the drive to the right, without network, clock and files
- `ciberrato.localization`: place and heading from any start, while it drives
- `agent.drives`: where to drive, by what the pose filter knows
- `agent.offline`: the filter over cells that runs after the drive
- `agent.views`: runs and beliefs to look at
- `agent.run`: link, clock, signals, threads and files around them
- `agent.commands`: the command line, one file a subcommand
"""
