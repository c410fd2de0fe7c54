"""Clients as strict as the real ones are, written from the protocol's description; our codec is not used.

The Python client drops exactly the last byte of what it reads and gives the rest to expat. The Java client
parses the same way, and wants lines of seven sensors. The C++ client wants a NUL in what it reads and takes
what stands before it. The viewer wants Parameters, then Lab, Grid and statuses in this order. All read into
buffers of a fixed size and lose what is longer.

They wait two seconds, no longer. Ours are patient, as their waiting would only say how busy this machine is;
that no client has to wait so long is shown with a clock of its own in test_pace.py.
"""

from __future__ import annotations

import socket
import xml.etree.ElementTree as ElementTree

PATIENCE = 300.0
TIME_LIMIT = 2.0
REPLY_SIZE = 1024
MEASURES_SIZE = 4096
STATES = {"Stopped", "Running", "Waiting", "Returning", "Finished", "Removed"}


class StrictRobot:
    """A robot client.

    Parameters
    ----------
    port : int
        The simulator's, on this machine.
    style : {"python", "java", "c++"}
        How messages end for it.
    position : int
    name : str
    angles : sequence of four float
    """

    def __init__(
        self,
        port: int,
        *,
        style: str = "python",
        position: int = 1,
        name: str = "pClient1",
        angles: tuple[float, ...] = (0.0, 60.0, -60.0, 180.0),
    ) -> None:
        self.style = style
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.settimeout(PATIENCE)
        self.socket.bind(("127.0.0.1", 0))
        sensors = "".join(f'<IRSensor Id="{i}" Angle="{angle}" />' for i, angle in enumerate(angles))
        registration = f'<Robot Id="{position}" Name="{name}">{sensors}</Robot>'
        self.send_to(registration, ("127.0.0.1", port))
        data, self.address = self.socket.recvfrom(REPLY_SIZE)
        assert self.address[1] != port, "the Reply comes from a port of its own"
        reply = self.parse(data)
        assert reply.tag == "Reply"
        self.accepted = reply.attrib["Status"] == "Ok"
        self.beacons = 0
        if self.accepted:
            (parameters,) = reply
            assert parameters.tag == "Parameters"
            self.sim_time = int(parameters.attrib["SimTime"])
            self.beacons = int(parameters.attrib["NBeacons"])
            for name in ("CycleTime", "KeyTime"):
                int(parameters.attrib[name])
            for name in ("CompassNoise", "BeaconNoise", "ObstacleNoise", "MotorsNoise", "BeaconAperture"):
                float(parameters.attrib[name])

    def parse(self, data: bytes) -> ElementTree.Element:
        """Parse a message as the client's library does."""
        if self.style == "c++":
            assert b"\0" in data, "without a NUL the string has no end"
            text = data[: data.index(b"\0")]
        else:
            text = data[:-1]
        return ElementTree.fromstring(text)

    def send_to(self, text: str, address: tuple[str, int]) -> None:
        """Send a message with the end that the client's library gives it."""
        end = b"\n\0" if self.style == "c++" else b""
        self.socket.sendto(text.encode() + end, address)

    def act(self, text: str) -> None:
        """Send an action."""
        self.send_to(text, self.address)

    def read(self) -> dict[str, object]:
        """Wait for Measures and read all of it, as the strictest client does.

        Returns
        -------
        dict
            ``time``, ``start``, ``stop``, ``end_led``, ``infrared``, ``line`` and whatever else is there.
        """
        data, address = self.socket.recvfrom(MEASURES_SIZE)
        assert address == self.address, "everything comes from one port"
        root = self.parse(data)
        assert root.tag == "Measures"
        found: dict[str, object] = {"time": int(root.attrib["Time"]), "infrared": {}, "beacons": []}
        assert [part.tag for part in root] == ["Sensors", "Leds", "Buttons"]
        sensors, leds, buttons = root
        found |= dict(sensors.attrib)
        for sensor in sensors:
            match sensor.tag:
                case "IRSensor":
                    number = int(sensor.attrib["Id"])
                    assert 0 <= number <= 3
                    found["infrared"][number] = float(sensor.attrib["Value"])  # type: ignore[index]
                case "BeaconSensor":
                    seen = found["beacons"]
                    assert isinstance(seen, list)
                    assert int(sensor.attrib["Id"]) == len(seen), "ids come without gaps"
                    value = sensor.attrib["Value"]
                    seen.append(None if value == "NotVisible" else int(value))
                case "LineSensor":
                    found["line"] = sensor.attrib["Value"]
                    assert len(sensor.attrib["Value"]) == 7
                case "GPS":
                    found["gps"] = (float(sensor.attrib["X"]), float(sensor.attrib["Y"]))
                    assert "Dir" not in sensor.attrib
                case "Message":
                    int(sensor.attrib["From"])
                    found["heard"] = sensor.text
                case "Score":
                    for name in ("Score", "ArrivalTime", "ReturningTime", "Collisions"):
                        int(sensor.attrib[name])
                    found["score"] = int(sensor.attrib["Score"])
                case other:
                    raise AssertionError(f"{other} is not known")
        assert len(found["beacons"]) in (0, self.beacons)  # type: ignore[arg-type]
        for name in ("EndLed", "ReturningLed", "VisitingLed"):
            found[name] = _switch(leds.attrib[name])
        found["start"], found["stop"] = _switch(buttons.attrib["Start"]), _switch(buttons.attrib["Stop"])
        return found

    def close(self) -> None:
        """Go away without a word, as clients do."""
        self.socket.close()


def _switch(word: str) -> bool:
    assert word in ("On", "Off")
    return word == "On"


class StrictViewer:
    """A viewer: on its own machine only, talking to the port that spoke last."""

    def __init__(self, port: int) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.settimeout(PATIENCE)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.sendto(b"<View/>\n\0", ("127.0.0.1", port))
        reply = self.read()
        assert reply.attrib["Status"] == "Ok"
        (parameters,) = reply  # nothing else may be in it
        for name in ("CycleTime", "SimTime"):
            int(parameters.attrib[name])
        self.lab_known = self.grid_known = False
        self.positions = 0

    def read(self) -> ElementTree.Element:
        """Wait for a message; it is a C string."""
        data, self.address = self.socket.recvfrom(65536)
        return ElementTree.fromstring(data.split(b"\0")[0])

    def send(self, text: str) -> None:
        """Send a command, with its NUL."""
        self.socket.sendto(text.encode() + b"\0", self.address)

    def read_world(self) -> None:
        """Ask for lab and grid in one go; both come, in this order, before the next status.

        With robots about, right after a status: so both are sure to be read in one cycle.
        """
        self.send("<LabReq/>")
        self.send("<GridReq/>")
        while not self.grid_known:
            message = self.read()
            if message.tag == "Lab":
                self.lab_known = True
                float(message.attrib["Width"]), float(message.attrib["Height"])
                heights = [float(beacon.attrib["Height"]) for beacon in message.iter("Beacon")]
                assert heights or not message.findall("Wall"), "walls are compared with the first beacon"
                for corner in message.iter("Corner"):
                    float(corner.attrib["X"]), float(corner.attrib["Y"])
            elif message.tag == "Grid":
                assert self.lab_known, "a grid before the lab would be lost"
                self.grid_known = True
                self.positions = len(message)
            else:
                assert not self.lab_known, "a status between lab and grid would be the end"

    def read_status(self) -> dict[str, object]:
        """Wait for a robot's status."""
        message = self.read()
        assert message.tag == "Robot"
        (position,) = message
        score = int(message.attrib["Score"])
        assert score >= 0, "read as unsigned"
        assert message.attrib["State"] in STATES
        assert message.attrib["Collision"] in ("True", "False")
        int(message.attrib["Collisions"])
        return {
            "id": int(message.attrib["Id"]),
            "time": int(message.attrib["Time"]),
            "state": message.attrib["State"],
            "pose": tuple(float(position.attrib[name]) for name in ("X", "Y", "Dir")),
        }

    def close(self) -> None:
        """Close the window: nothing is sent."""
        self.socket.close()
