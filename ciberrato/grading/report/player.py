"""The page that plays runs: the viewer's, with a recording in place of its connection.

Opened from a disk a browser loads no modules, so the viewer's are put together into one plain script: each
becomes a function that returns what it exports.
"""

from __future__ import annotations

import importlib.resources
import re

from ciberrato.grading.report.pieces import asset

_IMPORT = re.compile(r'^import \{([^}]*)\} from "\./([\w-]+)\.js";$', re.MULTILINE)
_EXPORT = re.compile(r"^export ((?:async )?(?:const|function|class)) ([\w$]+)", re.MULTILINE)
_MODULE_TAG = '<script type="module" src="main.js"></script>'
_BRAND = '<div class="brand">'


def player_files() -> dict[str, str]:
    """Return the player's files by name.

    Returns
    -------
    dict of str to str
        ``play.html`` is given the recording's name as ``?run=NAME``.
    """
    page = _viewers("index.html")
    assert page.count(_MODULE_TAG) == 1
    assert page.count(_BRAND) == 1
    page = page.replace(_MODULE_TAG, '<script defer src="play.js"></script>')
    page = page.replace(_BRAND, f'<a href="index.html" id="back">‹ All runs</a>{_BRAND}')
    return {
        "play.html": page,
        "play.js": bundle("main"),
        "style.css": _viewers("style.css") + asset("back.css"),
        "icon.svg": _viewers("icon.svg"),
    }


def _viewers(name: str) -> str:
    return importlib.resources.files("ciberrato.viewer").joinpath("assets", name).read_text(encoding="utf-8")


def bundle(main: str) -> str:
    """Bundle a module and all that it imports into one script.

    Parameters
    ----------
    main : str
        Name of a module of the viewer's page, without the suffix; ``socket`` is the player's own.

    Returns
    -------
    str
        A script of functions that are called in order of the imports.
    """
    done: dict[str, str] = {}
    under_way: list[str] = []

    def add(name: str) -> None:
        if name in done:
            return
        assert name not in under_way, f"modules import one another: {under_way}"
        under_way.append(name)
        text = asset("socket.js") if name == "socket" else _viewers(f"{name}.js")
        for _, imported in _IMPORT.findall(text):
            add(imported)
        under_way.pop()
        names = [found for _, found in _EXPORT.findall(text)]
        text = _IMPORT.sub(lambda found: f"const {{{found[1]}}} = {_module(found[2])};", text)
        text = _EXPORT.sub(r"\1 \2", text)
        assert not re.search(r"^(?:import|export)\b", text, re.MULTILINE), f"{name}.js: an unknown form"
        done[name] = f"const {_module(name)} = (() => {{\n{text}\nreturn {{ {', '.join(names)} }};\n}})();\n"

    add(main)
    return '"use strict";\n' + "\n".join(done.values())


def _module(name: str) -> str:
    return f"module_{name}"
