"""Names of others say nothing to a terminal."""

import sys
import unicodedata
from xml.etree import ElementTree

import pytest
from lxml import etree

from ciberrato.plaintext import UNSEEN_SIGN, plain, plain_lines, xml_text


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


def test_lines_stay_lines():
    assert plain_lines("one\r\ntwo\n\x1bthree\r\u2028") == "one\ntwo\n\ufffdthree\ufffd\ufffd"


def test_whatever_the_text_xml_can_hold_it_and_gives_it_back():
    text = xml_text("".join(map(chr, range(sys.maxunicode + 1))))
    root = ElementTree.Element("a", name=text.replace("\n", " "))
    root.text = text
    read = etree.fromstring(ElementTree.tostring(root, encoding="utf-8"), etree.XMLParser(huge_tree=True))
    assert read.text == text
    assert "\x1b" not in text
    assert "\ufffe" not in text
    assert text.count("\n") == 1
