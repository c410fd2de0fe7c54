"""Clients that speak the binary protocol: translated here, so that nothing else need know of them."""

from __future__ import annotations

from ciberrato.errors import ProtocolError
from ciberrato.protocol import Acceptance, Measures, Refusal, decode_simulator_message, encode
from ciberrato.protocol.binary import decode_binary_actions, encode_binary_measures, encode_binary_reply
from simulator_stub.service.transports.base import Newcomer, Peer


class BinaryNewcomer(Newcomer):
    """A client whose registration was a binary one.

    Parameters
    ----------
    newcomer : Newcomer
        As its transport has it.
    """

    def __init__(self, newcomer: Newcomer) -> None:
        self._newcomer = newcomer
        self.label = f"{newcomer.label}, binary"
        self.source = newcomer.source

    def accept(self) -> Peer:
        """Open its channel, with a translator."""
        return BinaryPeer(self._newcomer.accept(), self.label)


class BinaryPeer(Peer):
    """A client's channel: binary outside, XML inside.

    Parameters
    ----------
    peer : Peer
        As its transport has it.
    label : str
    """

    def __init__(self, peer: Peer, label: str) -> None:
        super().__init__(label)
        self._peer = peer
        self.source = peer.source
        self.serve_every_cycle = peer.serve_every_cycle  # type: ignore[method-assign]
        self.overflow = peer.overflow  # type: ignore[method-assign]
        peer.deliver = self._translate

    def _translate(self, data: bytes) -> None:
        try:
            data = encode(decode_binary_actions(data))
        except ProtocolError:
            data = b""  # which is a broken message in XML as well
        self.deliver(data)

    def send(self, data: bytes) -> None:
        """Send the Reply or Measures; the protocol has no more."""
        message = decode_simulator_message(data)
        if isinstance(message, Measures):
            self._peer.send(encode_binary_measures(message))
        elif isinstance(message, Acceptance | Refusal):
            self._peer.send(encode_binary_reply(message))

    @property
    def exhausted(self) -> bool:
        """Whether it has sent more than is read in a cycle."""
        return self._peer.exhausted

    def close(self) -> None:
        """Close the channel."""
        self.closed = True
        self._peer.close()
