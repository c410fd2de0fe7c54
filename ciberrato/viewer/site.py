"""Answers to HTTP requests (sans-IO).

Who may look: the page and its WebSocket are served to this machine only unless the user binds another
address, and then to those only who have the token. A page of another site that is open in the same browser
must not reach the simulator through us: its requests have a foreign Origin, or, where it has bent its own
name to 127.0.0.1, a foreign Host.

Files are looked up in a dictionary made at the start; no path of a request ever reaches the file system.
"""

from __future__ import annotations

import hmac
import http
import importlib.resources
import ipaddress
from collections.abc import Mapping
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs, urlsplit

from ciberrato.reprs import short_repr

SOCKET_PATH = "/socket"

_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
}

_HEADERS = (
    (
        "Content-Security-Policy",
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    ("X-Content-Type-Options", "nosniff"),
    ("Referrer-Policy", "no-referrer"),
    ("Cross-Origin-Opener-Policy", "same-origin"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
    ("Cache-Control", "no-cache"),
)


@dataclass(frozen=True, slots=True)
class Answer:
    """An HTTP response.

    Attributes
    ----------
    status : http.HTTPStatus
    headers : tuple of (name, value)
    body : bytes
    """

    __repr__ = short_repr

    status: http.HTTPStatus
    headers: tuple[tuple[str, str], ...]
    body: bytes


def read_assets() -> dict[str, tuple[str, bytes]]:
    """Read the page's files.

    Returns
    -------
    dict
        Path of the request to content type and bytes.
    """
    assets = {}
    for file in importlib.resources.files("ciberrato.viewer").joinpath("assets").iterdir():
        suffix = "." + file.name.rpartition(".")[2]
        if suffix in _TYPES:
            path = "/" if file.name == "index.html" else f"/{file.name}"
            assets[path] = (_TYPES[suffix], file.read_bytes())
    return assets


def is_loopback(host: str) -> bool:
    """Return whether a host to bind is this machine only."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


class Site:
    """Decides on requests.

    Parameters
    ----------
    port : int
        The one that we listen on.
    token : str or None
        Token required of browsers; None: all users of this machine may look.
    assets : mapping
        As `read_assets` gives them.
    """

    def __init__(self, *, port: int, token: str | None, assets: Mapping[str, tuple[str, bytes]]) -> None:
        self._token = token
        self._assets = assets
        self._cookie = f"ciberrato-viewer-{port}"  # cookies do not distinguish ports
        names = ("localhost", "127.0.0.1", "[::1]")
        self._own_hosts = {f"{name}:{port}" for name in names} | (set(names) if port == 80 else set())

    def respond(self, target: str, headers: Mapping[str, str]) -> Answer | None:
        """Decide on a request.

        Parameters
        ----------
        target : str
            As in the request line: path and query.
        headers : mapping
            Keys in any case, as the caller's mapping takes them.

        Returns
        -------
        Answer or None
            None lets the request become a WebSocket.
        """
        try:
            parts = urlsplit(target)
            host = headers.get("Host", "")
            shown = self._shown_token(parts.query)
        except (ValueError, LookupError):  # LookupError: several Host headers; ValueError: no URL, 9 fields
            return _refusal(http.HTTPStatus.BAD_REQUEST, "a request that no browser should send")
        if self._token is None and host.lower() not in self._own_hosts:
            return _refusal(http.HTTPStatus.FORBIDDEN, "this viewer is open to this machine only")
        if self._token is not None and not (
            _same(shown, self._token) or _same(self._cookie_token(headers), self._token)
        ):
            return _refusal(
                http.HTTPStatus.FORBIDDEN, "open the address with ?token=... that the viewer printed"
            )
        if parts.path == SOCKET_PATH:
            return self._socket(host, headers)
        asset = self._assets.get(parts.path)
        if asset is None:
            return _refusal(http.HTTPStatus.NOT_FOUND, "no such page")
        content_type, body = asset
        extra: tuple[tuple[str, str], ...] = ()
        if self._token is not None and shown is not None:
            # The scripts and the WebSocket show it from now on, without it being in their addresses.
            extra = (("Set-Cookie", f"{self._cookie}={self._token}; Path=/; HttpOnly; SameSite=Strict"),)
        return Answer(http.HTTPStatus.OK, (("Content-Type", content_type), *_HEADERS, *extra), body)

    def _socket(self, host: str, headers: Mapping[str, str]) -> Answer | None:
        try:
            origin = headers.get("Origin", "")
            upgrade = headers.get("Upgrade", "")
        except LookupError:
            return _refusal(http.HTTPStatus.BAD_REQUEST, "a request that no browser should send")
        if upgrade.lower() != "websocket":
            return _refusal(http.HTTPStatus.UPGRADE_REQUIRED, "a WebSocket", (("Upgrade", "websocket"),))
        if origin.lower() not in (f"http://{host.lower()}", f"https://{host.lower()}"):
            return _refusal(http.HTTPStatus.FORBIDDEN, "the page of this viewer only may connect")
        return None

    def _shown_token(self, query: str) -> str | None:
        values = parse_qs(query, max_num_fields=8).get("token") if len(query) < 1000 else None
        return values[0] if values else None

    def _cookie_token(self, headers: Mapping[str, str]) -> str | None:
        try:
            cookies = SimpleCookie(headers.get("Cookie", ""))
        except (CookieError, LookupError):
            return None
        morsel = cookies.get(self._cookie)
        return morsel.value if morsel is not None else None


def _same(shown: str | None, token: str) -> bool:
    return shown is not None and hmac.compare_digest(shown.encode(), token.encode())


def _refusal(status: http.HTTPStatus, reason: str, extra: tuple[tuple[str, str], ...] = ()) -> Answer:
    headers = (("Content-Type", "text/plain; charset=utf-8"), *_HEADERS, *extra)
    return Answer(status, headers, f"{status.value}: {reason}\n".encode())
