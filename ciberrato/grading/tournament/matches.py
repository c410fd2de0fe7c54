"""The runs of a tournament."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ciberrato.errors import UsageError
from ciberrato.files.start_grid import default_grid, read_grid
from ciberrato.grading.course import Agent, Course, GradedLab
from ciberrato.grading.task import digest_of, file_part, of_agent, of_course, of_lab
from ciberrato.grading.tournament.schedule import Meeting, schedule
from ciberrato.reprs import short_repr


@dataclass(frozen=True, slots=True)
class Match:
    """A run of several agents.

    Attributes
    ----------
    agents : tuple of Agent
        In order of the start places.
    lab, seed
    meeting : Meeting
    key : str
        Digest of everything that decides what comes of it.
    file : str
        Name of its recording, without the suffix.
    """

    __repr__ = short_repr

    agents: tuple[Agent, ...]
    lab: GradedLab
    seed: int
    meeting: Meeting
    key: str
    file: str


def places_of(lab: GradedLab) -> int:
    """Return how many start places a lab has."""
    return len((default_grid() if lab.grid is None else read_grid(lab.grid)).positions)


def matches_of(course: Course) -> list[Match]:
    """List the runs of a course's tournament: by lab, seed, round, group and turn.

    Every lab and seed has all meetings; labs of as many places have the same ones.

    Parameters
    ----------
    course : Course

    Returns
    -------
    list of Match

    Raises
    ------
    UsageError
        With fewer than two agents, or a lab with fewer than two places.
    """
    if len(course.agents) < 2:
        raise UsageError("a tournament needs two agents, [[agent]], or more")
    narrow = [lab.name for lab in course.labs if places_of(lab) < 2]
    if narrow:
        raise UsageError(
            f"a tournament needs labs with two start places or more: name a grid with them, grid = ..., for: "
            f"{', '.join(narrow)}"
        )
    settings = course.tournament
    common, programs = of_course(course), [of_agent(agent) for agent in course.agents]
    found = []
    for lab in course.labs:
        robots = min(places_of(lab), len(course.agents), settings.robots or len(course.agents))
        meetings = schedule(
            len(course.agents),
            robots,
            rounds=settings.rounds,
            rotate=settings.rotate,
            generator=np.random.default_rng(settings.draw),
        )
        world = of_lab(lab)
        for seed in course.seeds:
            for meeting in meetings:
                key = digest_of(
                    ["tournament", common, [programs[one] for one in meeting.agents], world, seed]
                )
                number = f"{meeting.round}-{meeting.group}-{meeting.turn}"
                file = f"t{number}-{file_part(lab.name)}-{seed}-{key[:8]}"
                agents = tuple(course.agents[one] for one in meeting.agents)
                found.append(Match(agents, lab, seed, meeting, key, file))
    return found
