import pytest

from ciberrato.errors import UsageError
from ciberrato.net import DEFAULT_PORT, TcpLink, UdpLink, parse_address


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("localhost", ("localhost", 6000)),
        ("192.168.1.7", ("192.168.1.7", 6000)),
        (" rato.example.org:7777 ", ("rato.example.org", 7777)),
        ("h:1", ("h", 1)),
        ("h:65535", ("h", 65535)),
        ("h:06000", ("h", 6000)),
        (":7103", ("127.0.0.1", 7103)),
    ],
)
def test_host_and_port_are_split(text, expected):
    assert parse_address(text) == expected


def test_the_default_port_is_the_real_simulators_and_can_be_another():
    assert DEFAULT_PORT == 6000
    assert parse_address("h", 7000) == ("h", 7000)
    assert parse_address("h:8000", 7000) == ("h", 8000)


@pytest.mark.parametrize(
    "text",
    [
        "",
        " ",
        ":",
        "h:",
        "h:0",
        "h:65536",
        "h:-1",
        "h:x",
        "h:6000.0",
        "h:٣",
        "::1",
        "[::1]:6000",
        "a b",
        "h:1:2",
    ],
)
def test_what_is_no_address_is_refused_and_quoted(text):
    with pytest.raises(UsageError) as caught:
        parse_address(text)
    assert repr(text) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("link", [UdpLink, TcpLink])
@pytest.mark.parametrize("host", ["no-such-host.invalid", "a" * 300, "x..y", "\0", "host name"])
def test_a_host_that_cannot_be_found_is_a_usage_error(link, host):
    with pytest.raises(UsageError, match="cannot be found"):
        link(host, 6000)


@pytest.mark.parametrize("link", [UdpLink, TcpLink])
@pytest.mark.parametrize("port", [0, -1, 65536])
def test_a_port_that_cannot_be_is_a_usage_error(link, port):
    with pytest.raises(UsageError, match="port"):
        link("127.0.0.1", port)
