"""From a match to a run: each agent in a sandbox of its own, all on one simulator."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from ciberrato.files.lab import read_lab
from ciberrato.files.parameters import parse_parameters
from ciberrato.grading.course import parameters_document
from ciberrato.grading.launch import ATTEMPTS, MEASURED, Launcher, RunError
from ciberrato.grading.outcome import Outcome, judge
from ciberrato.grading.tournament.keeper import KEEPER
from ciberrato.grading.tournament.matches import Match
from ciberrato.processes import module_command


class MatchLauncher(Launcher):
    """Does runs of a course's tournament; made and ended as its base is."""

    def play(self, match: Match) -> list[tuple[Outcome, dict[str, Any]]]:
        """Execute a run.

        An agent that could not be built, takes another's start place, or registers a second robot, does not
        take part: the others' run is done without it, its place stays empty.

        Parameters
        ----------
        match : Match

        Returns
        -------
        list of (Outcome, dict)
            For each agent in order of the places: what came of it, and what clocks and meters said.

        Raises
        ------
        RunError
            If it could not be.
        """
        targets = len(read_lab(match.lab.lab).targets)
        out: dict[int, tuple[Outcome, dict[str, Any]]] = {}
        files = [self._files(agent) for agent in match.agents]
        for number, (_, failure) in enumerate(files, 1):
            if failure is not None:
                outcome = Outcome(status="not built", detail="see the output", targets=targets)
                out[number] = outcome, {"tail": failure}
        attempt = 0
        while len(out) < len(match.agents):
            with tempfile.TemporaryDirectory(dir=self._temporary, ignore_cleanup_errors=True) as name:
                folder = Path(name)
                port = self._port(attempt, *(agent.command for agent in match.agents))
                wanted = self._match(match, [one for one, _ in files], folder, port, set(out))
                document = self._supervise(wanted, KEEPER)
                if document["error"] is not None:
                    attempt += 1
                    if document["busy"] and attempt < ATTEMPTS:
                        continue
                    raise RunError(str(document["error"]))
                if document["again"] is not None:
                    outcome = Outcome(status="never registered", detail=document["why"], targets=targets)
                    out[document["again"]] = outcome, {}
                    continue
                return self._judge(match, document, folder, targets, out)
        return [out[number] for number in range(1, len(match.agents) + 1)]

    def _match(
        self, match: Match, files: list[Path | None], folder: Path, port: int, out: set[int]
    ) -> dict[str, Any]:
        host = self._host()
        self._prepare(match.lab, folder)
        options = self._options(match.lab, match.seed, folder, host, port)
        names = [agent.name for agent in match.agents]
        return {
            "simulator": module_command("simulator_stub", *options, "--views", "1"),
            "host": host,
            "port": port,
            "agents": [
                None
                if number in out
                else self._program(
                    agent, match.lab, match.seed, own, folder / f"work{number}", host, port, number
                )
                for number, (agent, own) in enumerate(zip(match.agents, files, strict=True), 1)
            ],
            "limits": {
                name: getattr(self._course.limits, name) for name in ("time", "registration", "silence")
            },
            "result": str(folder / "result.json"),
            "log": str(folder / "log.xml"),
            "names": names,
            "title": f"of {' against '.join(names)}, {match.lab.name}, seed {match.seed}",
            "recording": str(self._recordings / f"{match.file}.js"),
        }

    def _judge(
        self,
        match: Match,
        document: dict[str, Any],
        folder: Path,
        targets: int,
        out: dict[int, tuple[Outcome, dict[str, Any]]],
    ) -> list[tuple[Outcome, dict[str, Any]]]:
        text = parameters_document(match.lab.parameters, match.lab.settings)
        cycle_time = parse_parameters(text).cycle_time
        found = []
        for number, own in enumerate(document["agents"], 1):
            if own is None:
                found.append(out[number])
                continue
            run = document["run"] or {"robots": []}
            robots = [robot for robot in run["robots"] if robot["id"] == own["robot"]]
            outcome = judge(
                own | {"run": run | {"robots": robots}},
                targets=targets,
                cycle_time=cycle_time,
                folder=folder / f"work{number}",
                reference=folder / "scoring",
                scoring=match.lab.scoring,
            )
            found.append((outcome, {name: own[name] for name in MEASURED}))
        return found
