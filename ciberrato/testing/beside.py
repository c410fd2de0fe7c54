"""The simulator as a process that does not outlive the tests that have started it, however they end."""

import sys


def main() -> int:
    """Run the simulator with the options of the command line."""
    from ciberrato.system.descendants import die_with_parent
    from simulator_stub.cli import main as simulate

    die_with_parent()
    return simulate(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
