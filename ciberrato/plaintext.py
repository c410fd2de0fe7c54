"""Names and texts of others, made harmless for terminals, figures and pages."""

from __future__ import annotations

import re
import unicodedata

_UNSEEN = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
# Joiners make letters and emoji of several signs into one: they hide nothing.
_JOINERS = "\u200c\u200d"
UNSEEN_SIGN = "\ufffd"
# Compiled when it is first used: that takes as long as a fifth of a program's start.
_NOT_XML = "[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]"


def plain(text: str, most: int | None = None) -> str:
    """Return a text in which nothing is unseen: no line ends, escapes, or signs that turn the text round.

    Parameters
    ----------
    text : str
    most : int or None
        Length at which it is cut, with an ellipsis at the end.

    Returns
    -------
    str
        Each character that is not seen is U+FFFD.
    """
    shown = "".join(
        UNSEEN_SIGN if unicodedata.category(sign) in _UNSEEN and sign not in _JOINERS else sign
        for sign in (text if most is None else text[: most + 1])
    )
    if most is None or len(shown) <= most:
        return shown
    return shown[: most - 1].rstrip() + "…"


def plain_lines(text: str) -> str:
    """Return `plain` of every line; line ends stay, as line feeds."""
    return "\n".join(map(plain, text.replace("\r\n", "\n").split("\n")))


def xml_text(text: str) -> str:
    """Return `plain_lines` of a text for XML 1.0: characters that XML cannot hold are U+FFFD, too."""
    return re.sub(_NOT_XML, UNSEEN_SIGN, plain_lines(text))
