"""Draws the track of a run: a process of its own, so that tests load no matplotlib."""

import sys
from pathlib import Path

from ciberrato.processes import module_command


def picture_command(lab: Path, truth: Path, target: Path, title: str) -> list[str]:
    """Return the command line that draws the track in a truth file."""
    return module_command("ciberrato.testing.picture", str(lab), str(truth), str(target), title)


def main() -> int:
    """Draw the picture that the command line describes."""
    from ciberrato.errors import CiberratoError
    from ciberrato.files.lab import read_lab
    from ciberrato.files.truth import read_truth
    from ciberrato.labtool.picture import draw_track

    lab, truth, target, title = sys.argv[1:]
    try:
        poses = [(x, y) for _, (x, y, _) in sorted(read_truth(truth).items())]
        draw_track(read_lab(lab), Path(target), poses, title)
    except CiberratoError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
