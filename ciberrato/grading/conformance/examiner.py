"""The simulator's place in a row: a process that `ciberrato.grading.supervisor` starts as one.

It says what a simulator says, so that the supervisor knows where the row stands, and writes what it has seen
into the result file.
"""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

from ciberrato.files.atomic import replace_file
from ciberrato.files.lab import read_lab
from ciberrato.files.parameters import read_parameters
from ciberrato.files.start_grid import default_grid, read_grid
from ciberrato.grading.conformance.desk import Desk, Fault
from ciberrato.grading.conformance.rows import END, LONG
from ciberrato.grading.conformance.scripts import Examination, Seen
from ciberrato.processes import module_command

AFTER_A_FAULT = 1.0
"""Seconds that an agent gets to end after a fault, so that its status and last words are known."""


def examiner_command(**wanted: object) -> list[str]:
    """Return the command line of the examiner.

    Parameters
    ----------
    **wanted
        ``row``, ``host``, ``port``, ``lab``, ``grid`` (or None), ``parameters``, ``seed``, ``patience``
        (seconds), ``result`` (file).
    """
    return module_command("ciberrato.grading.conformance.examiner", json.dumps(wanted))


def main() -> int:
    """Check the row that the command line names."""
    from simulator_stub.simulation import Simulation

    wanted = json.loads(sys.argv[1])
    grid = default_grid() if wanted["grid"] is None else read_grid(wanted["grid"])
    parameters = read_parameters(wanted["parameters"])
    if wanted["row"] == "end":
        parameters = replace(parameters, sim_time=LONG)
    simulation = Simulation(read_lab(wanted["lab"]), grid, parameters, wanted["seed"])
    try:
        desk = Desk(simulation, wanted["host"], wanted["port"])
    except OSError as error:
        print(f"cannot listen on udp {wanted['host']}:{wanted['port']}: {error.strerror}", flush=True)
        return 2
    print(f"listening on udp {wanted['host']}:{desk.port}", flush=True)
    examination = Examination(
        desk, wanted["patience"], lambda name: print(f"robot {name} registered from udp", flush=True)
    )
    fault = None
    seen = Seen("")
    try:
        seen = examination.examine(wanted["row"])
    except Fault as error:
        fault = str(error)
    grace = AFTER_A_FAULT if fault is not None else 0.0 if seen.ending == "any" else END
    run = {"fault": fault, "seen": seen.text, "ending": seen.ending, "grace": grace}
    replace_file(Path(wanted["result"]), json.dumps({"runs": [run]}).encode())
    desk.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
