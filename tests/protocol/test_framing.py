"""Messages on a stream."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ciberrato.errors import ProtocolError
from ciberrato.protocol import MessageSplitter

messages = st.lists(st.binary(max_size=30).map(lambda data: data.replace(b"\0", b"") + b"\0"), max_size=20)


@settings(deadline=None)
@given(messages, st.binary(max_size=5).map(lambda data: data.replace(b"\0", b"")), st.data())
def test_however_a_stream_is_cut_the_same_messages_come_out(sent, rest, data):
    stream = b"".join(sent) + rest
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=10)))
    splitter = MessageSplitter()
    received = []
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        received += splitter.feed(stream[start:end])
    assert received == sent
    assert splitter.pending == len(rest)


def test_the_size_of_a_message_is_bounded():
    splitter = MessageSplitter(limit=10)
    assert splitter.feed(b"123456789\0") == [b"123456789\0"]
    assert splitter.feed(b"12345") == []
    assert splitter.feed(b"6789\0x\0") == [b"123456789\0", b"x\0"]
    for too_long in (b"1234567890\0", b"x\0001234567890", b"1234567890"):
        with pytest.raises(ProtocolError, match="10 bytes"):
            MessageSplitter(limit=10).feed(too_long)


def test_a_message_that_never_ends_takes_no_more_memory_than_the_limit():
    splitter = MessageSplitter(limit=1000)
    for _ in range(999):
        assert splitter.feed(b"x") == []
    assert splitter.pending == 999
    with pytest.raises(ProtocolError):
        splitter.feed(b"x")
    assert splitter.pending == 0
