"""Every figure of the agent, for the manual, from one run of the demonstration.

``python -m examples.agent_figures FOLDER`` runs simulator and agent once and draws what docs/figures.md
lists.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from agent.cli import main as agent
from agent.views.figures.animation import animate_poses
from ciberrato import Robot, find_grid, find_lab, read_grid, read_lab
from ciberrato.errors import UsageError
from ciberrato.files.run_log import read_run
from ciberrato.front.demo import demonstrate
from examples.viewer_figures import shrink
from simulator_stub.simulation import Simulation

ANIMATION_FRAME = 34
"""Frame of the animation that is shown as a picture: one with the robot under way."""


def main(argv: Sequence[str] | None = None) -> int:
    """Draw all figures.

    Parameters
    ----------
    argv : sequence of str or None
        The folder to write to.

    Returns
    -------
    int
        Exit status.
    """
    words = sys.argv[1:] if argv is None else list(argv)
    if len(words) != 1:
        print("usage: python -m examples.agent_figures FOLDER", file=sys.stderr)
        return 2
    target = Path(words[0])
    target.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        run = Path(scratch)
        demonstrate(run, 7)
        draw_all(run, target)
        draw_drive(run / "drive.jsonl", target / "run.gif")
    return 0


def draw_drive(log: Path, target: Path) -> None:
    """Drive through `maze` with two rules and draw what the pose filter believes meanwhile.

    Parameters
    ----------
    log : Path
        Gets the run.
    target : Path
        The animation.
    """
    lab = read_lab(find_lab("maze"))
    simulation = Simulation(lab, read_grid(find_grid("maze")), seed=7)
    truth = {}
    with Robot("rosa", simulation=simulation, localize="maze", angles=(0, 60, -60, 180), log=log) as robot:
        for measures in robot:
            ahead, left, right, _ = (value or 0.0 for value in measures.infrared)
            turn = 0.1 if left < right else -0.1
            robot.drive(-turn, turn) if ahead > 1.2 else robot.drive(0.12, 0.12)
            x, y, heading = simulation.poses()[0]
            truth[measures.time] = (float(x), float(y), math.degrees(heading))
            if measures.time == 160:
                robot.finish()
    animate_poses(read_run(log), lab, target, truth=truth, every=4)


def draw_all(run: Path, target: Path) -> None:
    """Draw what docs/figures.md lists.

    Parameters
    ----------
    run : Path
        Folder of a demonstration's files.
    target : Path
        Folder of the figures.

    Raises
    ------
    UsageError
        If one of them cannot be made.
    """
    beliefs, log, truth = (str(run / name) for name in ("localization.out", "run.jsonl", "truth.csv"))
    known = ["--run", log, "--truth", truth]
    seed = str(run / "seed.out")
    for words in (
        ["draw", "walls", "-m", "rooms", "-o", str(target / "agent-walls.png")],
        ["draw", "cones", "-m", "standard", "--cell", "5,7", "-o", str(target / "agent-cones.png")],
        ["draw", "table", "-m", "standard", "-o", str(target / "agent-table.png")],
        ["draw", "beliefs", "--beliefs", beliefs, *known, "-o", str(target / "agent-beliefs.png")],
        ["draw", "curves", "--beliefs", beliefs, *known, "-o", str(target / "agent-curves.png")],
        ["draw", "errors", *known, "-o", str(target / "agent-errors.png")],
        ["localize", log, "-m", "standard", "--preset", "seed", "-o", seed, "--quiet"],
        ["compare", seed, beliefs, "-m", "standard", "--png", str(target / "agent-differences.png")],
        ["animate", log, "-m", "standard", "--truth", truth, "-o", str(run / "run.gif")],
    ):
        if agent(words):
            raise UsageError(f"ciberrato-agent {' '.join(words)} failed")
    from PIL import Image

    with Image.open(run / "run.gif") as animation:
        animation.seek(min(ANIMATION_FRAME, getattr(animation, "n_frames", 1) - 1))
        animation.convert("RGB").save(target / "agent-animation.png")
    for picture in sorted(target.glob("agent-*.png")):
        shrink(picture)


if __name__ == "__main__":
    sys.exit(main())
