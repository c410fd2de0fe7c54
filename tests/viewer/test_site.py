"""Who may look: hosts, origins, tokens, paths."""

from http import HTTPStatus

import pytest

from ciberrato.viewer.site import Site, is_loopback, read_assets

ASSETS = {"/": ("text/html; charset=utf-8", b"<page>"), "/main.js": ("text/javascript", b"js")}
HOST = {"Host": "127.0.0.1:6080"}
UPGRADE = HOST | {"Upgrade": "websocket"}


@pytest.fixture
def site():
    return Site(port=6080, token=None, assets=ASSETS)


@pytest.fixture
def guarded():
    return Site(port=6080, token="s3cret", assets=ASSETS)


def status(answer):
    return None if answer is None else answer.status


def test_serves_its_files_with_headers_that_keep_others_out(site):
    answer = site.respond("/", HOST)
    assert (answer.status, answer.body) == (HTTPStatus.OK, b"<page>")
    headers = dict(answer.headers)
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    assert "script-src 'self'" in headers["Content-Security-Policy"]
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert site.respond("/main.js?v=1", HOST).body == b"js"


@pytest.mark.parametrize(
    "path",
    [
        "/../server.py",
        "/..%2fserver.py",
        "/assets/../../pyproject.toml",
        "//etc/passwd",
        "/etc/passwd",
        "/%2e%2e/%2e%2e/etc/passwd",
        "/main.js/..",
        "/main.js%00.html",
        "/./main.js",
        "\\..\\server.py",
        "main.js",
        "",
        "http://127.0.0.1:6080",
        "http://[",
        "/" + "a" * 10_000,
    ],
)
def test_no_path_leads_out_of_the_page(site, path):
    assert site.respond(path, HOST).status in (HTTPStatus.NOT_FOUND, HTTPStatus.BAD_REQUEST)


@pytest.mark.parametrize("host", ["localhost:6080", "127.0.0.1:6080", "[::1]:6080", "LOCALHOST:6080"])
def test_this_machine_may_look(site, host):
    assert site.respond("/", {"Host": host}).status is HTTPStatus.OK


@pytest.mark.parametrize(
    "host", ["", "evil.example:6080", "127.0.0.1", "127.0.0.1:6081", "127.0.0.1:6080.evil"]
)
def test_a_name_that_was_bent_to_this_machine_may_not(site, host):
    assert site.respond("/", {"Host": host}).status is HTTPStatus.FORBIDDEN
    headers = UPGRADE | {"Host": host, "Origin": f"http://{host}"}
    assert site.respond("/socket", headers).status is HTTPStatus.FORBIDDEN


def test_the_own_page_may_connect(site):
    assert site.respond("/socket", UPGRADE | {"Origin": "http://127.0.0.1:6080"}) is None


@pytest.mark.parametrize(
    "origin", [None, "", "null", "http://evil.example", "http://127.0.0.1:6081", "http://localhost:6080"]
)
def test_other_pages_may_not_connect(site, origin):
    headers = UPGRADE if origin is None else UPGRADE | {"Origin": origin}
    assert site.respond("/socket", headers).status is HTTPStatus.FORBIDDEN


def test_the_socket_is_no_page(site):
    assert site.respond("/socket", HOST).status is HTTPStatus.UPGRADE_REQUIRED


def test_elsewhere_nothing_is_shown_without_the_token(guarded):
    far = {"Host": "lab-pc:6080"}
    for path in ("/", "/main.js", "/nothing", "/?token=", "/?token=S3CRET", "/?token=s3cret%00"):
        assert guarded.respond(path, far).status is HTTPStatus.FORBIDDEN
    connecting = far | {"Upgrade": "websocket", "Origin": "http://lab-pc:6080"}
    assert guarded.respond("/socket", connecting).status is HTTPStatus.FORBIDDEN
    assert guarded.respond("/socket", connecting | {"Cookie": "ciberrato-viewer-6080=x"}) is not None


def test_the_token_is_kept_in_a_cookie_that_scripts_cannot_read(guarded):
    far = {"Host": "lab-pc:6080"}
    answer = guarded.respond("/?token=s3cret", far)
    assert answer.status is HTTPStatus.OK
    cookie = dict(answer.headers)["Set-Cookie"]
    assert cookie.startswith("ciberrato-viewer-6080=s3cret;")
    assert {"HttpOnly", "SameSite=Strict"} <= {part.strip() for part in cookie.split(";")}
    shown = far | {"Cookie": f"other=1; {cookie.split(';')[0]}"}
    assert guarded.respond("/main.js", shown).status is HTTPStatus.OK
    connecting = shown | {"Upgrade": "websocket", "Origin": "http://lab-pc:6080"}
    assert guarded.respond("/socket", connecting) is None
    assert guarded.respond("/socket", connecting | {"Origin": "http://evil"}).status is HTTPStatus.FORBIDDEN


@pytest.mark.parametrize(
    "query", ["token=" + "x" * 2000, "&".join(f"a{n}=1" for n in range(20)), "token=%ff"]
)
def test_odd_queries_are_refused(guarded, query):
    assert status(guarded.respond(f"/?{query}", HOST)) in (HTTPStatus.FORBIDDEN, HTTPStatus.BAD_REQUEST)


@pytest.mark.parametrize("host", ["127.0.0.1", "127.1.2.3", "localhost", "::1"])
def test_loopback_is_recognized(host):
    assert is_loopback(host)


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.1", "::", "lab-pc", ""])
def test_everything_else_is_not_loopback(host):
    assert not is_loopback(host)


def test_every_file_that_the_page_names_is_shipped():
    assets = read_assets()
    assert {"/", "/main.js", "/style.css", "/icon.svg"} <= set(assets)
    page = assets["/"][1].decode()
    for name in ("style.css", "main.js", "icon.svg"):
        assert f'"{name}"' in page
    for path, (kind, body) in assets.items():
        if kind.startswith("text/javascript"):
            for line in body.decode().splitlines():
                if line.startswith("import "):
                    assert line.split('"./')[1].rstrip('";') in {p[1:] for p in assets}, path


def test_the_page_asks_nobody_else():
    for path, (_, body) in read_assets().items():
        text = body.decode().replace("http://www.w3.org/", "")
        assert "http://" not in text, path
        assert "https://" not in text.replace('"https:"', ""), path
        assert "style=" not in text, f"{path}: the page's policy forbids style attributes"
