"""Coverage-guided fuzzing of everything that reads bytes of others (Atheris, which is libFuzzer for Python).

As a program, each reader for so long, the inputs that reached something new kept in ``build/fuzz``::

    python -m tests.chaos.fuzz [READER ...] [--seconds 600]

It begins with tests/data/fuzz, which holds a few inputs a reader: right ones, those that
once did what they must not, and a dozen of the last that reached something new.
`tests/chaos/test_fuzz_corpus.py` replays them without Atheris.
"""

from __future__ import annotations

import argparse
import importlib.util
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).parents[2]
CORPUS = ROOT / "tests/data/fuzz"
READERS = (
    *("lab", "grid", "parameters", "run_log", "beliefs", "simulator_log"),
    *("from_clients", "from_simulator", "binary", "overlay", "course"),
)
MOST_SECONDS = 10
"""For one input of at most `MOST_BYTES`; wide, for a machine that is busy with other things."""
MOST_BYTES = 4096


def reader(name: str, folder: Path) -> Callable[[bytes], None]:
    """Return what reads bytes as one kind of input, and takes a `CiberratoError` of one line for an answer.

    Parameters
    ----------
    name : str
        One of `READERS`.
    folder : Path
        For readers of files: an empty one, best in memory.
    """
    from ciberrato.errors import CiberratoError

    file = folder / "input"
    read = _reads(name)

    def take(data: bytes) -> None:
        what: object = data
        if name in ("run_log", "beliefs", "simulator_log", "course"):
            file.write_bytes(data)
            what = file
        for one in read:
            try:
                one(what)
            except CiberratoError as error:
                # Of a course all faults are told, a line each.
                if not str(error) or (name != "course" and "\n" in str(error)):
                    raise RuntimeError(f"not a message of one line: {error!r}") from error

    return take


def _reads(name: str) -> list[Callable[..., object]]:
    from ciberrato import protocol
    from ciberrato.files import beliefs, lab, parameters, run_log, simulator_log, start_grid
    from ciberrato.grading.course import read_course
    from ciberrato.overlay import decode_overlay
    from ciberrato.protocol.binary import decode_binary_actions, decode_binary_registration

    told: list[str] = []
    found: dict[str, list[Callable[..., object]]] = {
        "lab": [lab.parse_lab_file],
        "grid": [start_grid.parse_grid_file],
        "parameters": [parameters.parse_parameter_file],
        "run_log": [run_log.read_run, lambda path: run_log.read_run(path, salvage=told.append)],
        "beliefs": [beliefs.read_beliefs],
        "simulator_log": [simulator_log.read_simulator_log],
        "from_clients": [
            protocol.decode_registration,
            protocol.decode_actions,
            protocol.decode_view_command,
        ],
        "from_simulator": [protocol.decode_simulator_message],
        "binary": [decode_binary_registration, decode_binary_actions],
        "overlay": [decode_overlay],
        "course": [read_course],
    }
    return found[name]


def seeds(name: str) -> list[bytes]:
    """Inputs to begin with, beside those that were kept: what ships, and one right message of each kind."""
    kept = [path.read_bytes() for path in sorted((CORPUS / name).glob("*"))]
    shipped = {"lab": "*_lab.xml", "grid": "*_grid.xml", "parameters": "*_params.xml"}
    return kept + [path.read_bytes() for path in sorted((ROOT / "maps").glob(shipped.get(name, "-")))]


def _fuzz(name: str, folder: str, seconds: int) -> None:
    """Fuzz one reader in this process, which ends with it."""
    import atheris

    with (
        atheris.instrument_imports(include=["ciberrato", "json", "tomllib"]),
        tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as files,
    ):
        from ciberrato.labtool import making

        # Each search in vain for a random lab costs instrumented code 38 MB for good; none without Atheris.
        making.TRIES = 3
        take = reader(name, Path(files))
        for data in seeds(name):  # what is imported late is not part of the first input's time
            take(data)
        options = [
            f"-max_total_time={seconds}",
            f"-max_len={MOST_BYTES}",
            f"-timeout={MOST_SECONDS}",
            "-rss_limit_mb=1024",
            "-print_final_stats=1",
            f"-artifact_prefix={folder}-found-",
        ]
        atheris.Setup([sys.argv[0], folder, *options], take)
        atheris.Fuzz()


def main() -> int:
    """Fuzz the named readers, or all, one after the other; return 1 if one did what it must not."""
    parser = argparse.ArgumentParser(description="Fuzz the readers, guided by coverage.")
    listed = ", ".join(READERS)
    parser.add_argument("readers", nargs="*", choices=[*READERS, []], metavar="READER", help=listed)
    parser.add_argument("--seconds", type=int, default=600, help="a reader; default: 600")
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if importlib.util.find_spec("atheris") is None:
        print("fuzz: needs Atheris: python -m pip install atheris", file=sys.stderr)
        return 2
    status = 0
    for name in options.readers or READERS:
        folder = ROOT / "build/fuzz" / name
        if options.here:
            _fuzz(name, str(folder), options.seconds)
        folder.mkdir(parents=True, exist_ok=True)
        for number, data in enumerate(seeds(name)):
            (folder / f"seed-{number}").write_bytes(data)
        command = [sys.executable, "-m", "tests.chaos.fuzz", name, "--here", f"--seconds={options.seconds}"]
        ended = subprocess.run(command, cwd=ROOT, stderr=subprocess.PIPE, text=True, errors="replace")
        (folder.parent / f"{name}.txt").write_text(ended.stderr)
        done = [line for line in ended.stderr.splitlines() if line.startswith(("stat::number_of", "Done"))]
        last = [line for line in ended.stderr.splitlines() if "cov: " in line][-1:]
        print(f"{name}: {'ok' if ended.returncode == 0 else 'FAILED'}", *last, *done, sep="\n  ", flush=True)
        status |= ended.returncode != 0
    return int(status)


if __name__ == "__main__":
    sys.exit(main())
