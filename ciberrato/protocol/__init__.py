"""The wire protocol: bytes to frozen records and back, without any input or output.

Every decoder raises `ciberrato.errors.ProtocolError` for bytes that are not its kind of message, and nothing
else. The manual is docs/protocol.md.
"""

from __future__ import annotations

TYPE_CHECKING = False
if TYPE_CHECKING:
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
        Acceptance,
        Actions,
        BeaconReading,
        ClientMessage,
        GridRequest,
        HeardMessage,
        LabRequest,
        Measures,
        OtherReading,
        Refusal,
        RemoveRobot,
        Reset,
        Restart,
        RobotStatus,
        ScoreReading,
        SimulatorMessage,
        Start,
        Stop,
        ViewCommand,
    )
    from ciberrato.protocol.parameters_text import decode_parameters, encode_parameters
    from ciberrato.protocol.registrations import (
        DEFAULT_SENSOR_ANGLES,
        PanelRegistration,
        Registration,
        RobotBeaconRegistration,
        RobotRegistration,
        ViewRegistration,
    )
    from ciberrato.protocol.simulator_decoding import decode_simulator_message

_HOMES = {
    "ACTIONS_LIMIT": "ciberrato.protocol.limits",
    "Acceptance": "ciberrato.protocol.messages",
    "Actions": "ciberrato.protocol.messages",
    "BeaconReading": "ciberrato.protocol.messages",
    "ClientMessage": "ciberrato.protocol.messages",
    "DEFAULT_SENSOR_ANGLES": "ciberrato.protocol.registrations",
    "GridRequest": "ciberrato.protocol.messages",
    "HeardMessage": "ciberrato.protocol.messages",
    "LabRequest": "ciberrato.protocol.messages",
    "MEASURES_LIMIT": "ciberrato.protocol.limits",
    "MESSAGE_LIMIT": "ciberrato.protocol.limits",
    "Measures": "ciberrato.protocol.messages",
    "MessageSplitter": "ciberrato.protocol.framing",
    "OtherReading": "ciberrato.protocol.messages",
    "PanelRegistration": "ciberrato.protocol.registrations",
    "PassedOverError": "ciberrato.protocol.client_decoding",
    "REGISTRATION_LIMIT": "ciberrato.protocol.limits",
    "REPLY_LIMIT": "ciberrato.protocol.limits",
    "Refusal": "ciberrato.protocol.messages",
    "Registration": "ciberrato.protocol.registrations",
    "RemoveRobot": "ciberrato.protocol.messages",
    "Reset": "ciberrato.protocol.messages",
    "Restart": "ciberrato.protocol.messages",
    "RobotBeaconRegistration": "ciberrato.protocol.registrations",
    "RobotRegistration": "ciberrato.protocol.registrations",
    "RobotStatus": "ciberrato.protocol.messages",
    "SAY_LIMIT": "ciberrato.protocol.limits",
    "ScoreReading": "ciberrato.protocol.messages",
    "SimulatorMessage": "ciberrato.protocol.messages",
    "Start": "ciberrato.protocol.messages",
    "Stop": "ciberrato.protocol.messages",
    "VIEW_COMMAND_LIMIT": "ciberrato.protocol.limits",
    "ViewCommand": "ciberrato.protocol.messages",
    "ViewRegistration": "ciberrato.protocol.registrations",
    "decode_actions": "ciberrato.protocol.client_decoding",
    "decode_parameters": "ciberrato.protocol.parameters_text",
    "decode_registration": "ciberrato.protocol.client_decoding",
    "decode_simulator_message": "ciberrato.protocol.simulator_decoding",
    "decode_view_command": "ciberrato.protocol.client_decoding",
    "encode": "ciberrato.protocol.encoding",
    "encode_parameters": "ciberrato.protocol.parameters_text",
    "fit_reply": "ciberrato.protocol.encoding",
    "grid_to_xml": "ciberrato.protocol.lab_text",
    "lab_to_xml": "ciberrato.protocol.lab_text",
    "measures_to_xml": "ciberrato.protocol.measures_text",
}

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


def __getattr__(name: str) -> object:
    """Load a name at its first use (PEP 562): a robot registers before it needs the other messages."""
    from ciberrato.lazy_names import load

    return load(globals(), _HOMES, name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
