import base64
import gzip
import json
from pathlib import Path

import pytest

GOLDEN = Path(__file__).parents[1] / "data" / "golden"


@pytest.fixture(scope="session")
def recorded_from_simulator():
    """Every distinct datagram that the real simulator sent in the recordings, with its place."""
    found = {}
    for place, event, data in _events():
        if event.get("direction") == "sim->client" or event.get("from") == "simulator":
            found.setdefault(data, place)
    return found


@pytest.fixture(scope="session")
def recorded_from_clients():
    """Every distinct datagram that clients sent in the recordings, with its place."""
    found = {}
    for place, event, data in _events():
        if event.get("direction") == "client->sim" or event.get("from") == "agent":
            found.setdefault(data, place)
    return found


def _events():
    for path in sorted((GOLDEN / "transcripts").glob("*.jsonl.gz")):
        with gzip.open(path, "rt", encoding="utf-8") as lines:
            for number, line in enumerate(lines, 1):
                event = json.loads(line)
                yield f"{path.name}:{number}", event, base64.b64decode(event["payload_b64"])
    for path in sorted((GOLDEN / "seed_runs").glob("*/datagrams.jsonl")):
        with path.open(encoding="utf-8") as lines:
            for number, line in enumerate(lines, 1):
                event = json.loads(line)
                yield f"{path.parent.name}:{number}", event, base64.b64decode(event["bytes"])
