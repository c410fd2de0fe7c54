"""Names of others say nothing to a terminal."""

import sys
import unicodedata

import pytest

from ciberrato.plaintext import UNSEEN_SIGN, plain


def test_of_all_characters_only_those_that_are_seen_stay():
    for code in range(sys.maxunicode + 1):
        sign = chr(code)
        kept = plain(sign) == sign
        unseen = unicodedata.category(sign) in ("Cc", "Cf", "Cs", "Zl", "Zp") and code not in (0x200C, 0x200D)
        assert kept is not unseen, hex(code)
        assert kept or plain(sign) == UNSEEN_SIGN


@pytest.mark.parametrize(
    ("text", "most", "expected"),
    [
        ("mouse", None, "mouse"),
        ("mouse", 5, "mouse"),
        ("mouse", 4, "mou…"),
        ("a b c", 3, "a…"),
        ("x" * 400, 24, "x" * 23 + "…"),
        ("\x1b[31mred", 8, "\ufffd[31mred"),
        ("Maus Ü, 鼠, \u05d0", None, "Maus Ü, 鼠, \u05d0"),
    ],
)
def test_long_texts_are_cut(text, most, expected):
    assert plain(text, most) == expected
