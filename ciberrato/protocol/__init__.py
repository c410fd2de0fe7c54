"""The wire protocol: bytes to frozen records and back, without any input or output.

Every decoder raises `ciberrato.errors.ProtocolError` for bytes that are not its kind of message, and nothing
else. The manual is docs/protocol.md.
"""

from ciberrato.protocol.client_decoding import (
    PassedOverError,
    decode_actions,
    decode_registration,
    decode_view_command,
)
from ciberrato.protocol.encoding import encode, fit_reply
from ciberrato.protocol.framing import MessageSplitter
from ciberrato.protocol.lab_text import grid_to_xml, lab_to_xml
from ciberrato.protocol.limits import (
    ACTIONS_LIMIT,
    MEASURES_LIMIT,
    MESSAGE_LIMIT,
    REGISTRATION_LIMIT,
    REPLY_LIMIT,
    SAY_LIMIT,
    VIEW_COMMAND_LIMIT,
)
from ciberrato.protocol.measures_text import measures_to_xml
from ciberrato.protocol.messages import (
    DEFAULT_SENSOR_ANGLES,
    Acceptance,
    Actions,
    BeaconReading,
    ClientMessage,
    GridRequest,
    HeardMessage,
    LabRequest,
    Measures,
    OtherReading,
    PanelRegistration,
    Refusal,
    Registration,
    RemoveRobot,
    Reset,
    Restart,
    RobotBeaconRegistration,
    RobotRegistration,
    RobotStatus,
    ScoreReading,
    SimulatorMessage,
    Start,
    Stop,
    ViewCommand,
    ViewRegistration,
)
from ciberrato.protocol.parameters_text import decode_parameters, encode_parameters
from ciberrato.protocol.simulator_decoding import decode_simulator_message

__all__ = [
    "ACTIONS_LIMIT",
    "DEFAULT_SENSOR_ANGLES",
    "MEASURES_LIMIT",
    "MESSAGE_LIMIT",
    "REGISTRATION_LIMIT",
    "REPLY_LIMIT",
    "SAY_LIMIT",
    "VIEW_COMMAND_LIMIT",
    "Acceptance",
    "Actions",
    "BeaconReading",
    "ClientMessage",
    "GridRequest",
    "HeardMessage",
    "LabRequest",
    "Measures",
    "MessageSplitter",
    "OtherReading",
    "PanelRegistration",
    "PassedOverError",
    "Refusal",
    "Registration",
    "RemoveRobot",
    "Reset",
    "Restart",
    "RobotBeaconRegistration",
    "RobotRegistration",
    "RobotStatus",
    "ScoreReading",
    "SimulatorMessage",
    "Start",
    "Stop",
    "ViewCommand",
    "ViewRegistration",
    "decode_actions",
    "decode_parameters",
    "decode_registration",
    "decode_simulator_message",
    "decode_view_command",
    "encode",
    "encode_parameters",
    "fit_reply",
    "grid_to_xml",
    "lab_to_xml",
    "measures_to_xml",
]
