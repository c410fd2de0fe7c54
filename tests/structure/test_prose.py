"""Words: those of the list in CONTRIBUTING.md are avoided; docstrings begin with a verb in the imperative."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCES = ("ciberrato", "agent", "simulator_stub", "examples", "benchmarks")
AVOIDED = re.compile(
    r"\b(whoever|whomever|nobody|somebody|at the (most|least|longest)|by way of|save for|for ever)\b",
    re.IGNORECASE,
)
FIRST_WORDS = re.compile(
    # What is not the imperative of a plain verb: the third person, questions, nouns,
    r"(Gives|Tells|Returns|Computes|Makes|Whether|Which|Who|How|What|Where|Why|When|As|All|The|An?|It|At|For|"
    r"Nothing|Everything|Between|Most|Only|Mean|Distances?|Lengths?|Values?|Weights?|Numbers|Names|Lines?|"
    r"Angles?|Pose|Headings|Entropy|Evidence|Probability|Points|Greatest|Nearest|Direction|Logarithm|Walls|"
    r"Rows|Sides|Root|Powers?|Motor|Price|Folder|Options|Seed|"
    # and verbs that mean too much: return, compute, create, update, process, run, report say which.
    r"Give|Tell|Say|See|Let|Put|Lay|Bring|Have|Hand|Take|Make|Hear|Look|Leave|Go|Work|Try|Talk|Complain)\b"
)
OF_PROPERTIES = re.compile(
    r"(How|What|Where|Why|When|Which|Who|See|That|With|All|Everything|Give|Tell|Say)\b"
)


def texts():
    """Yield path and text of what people read: sources, pages of the manual, the page of the viewer."""
    for folder in (*SOURCES, "docs"):
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in {".py", ".md", ".js", ".html", ".css", ".toml"} and "_api" not in path.parts:
                yield path, path.read_text(encoding="utf-8")
    for name in ("README.md", "CHANGELOG.md"):
        yield ROOT / name, (ROOT / name).read_text(encoding="utf-8")


def test_words_of_the_list_are_avoided():
    found = [
        f"{path.relative_to(ROOT)}:{number}: {match[0]}"
        for path, text in texts()
        for number, line in enumerate(text.splitlines(), 1)
        if (match := AVOIDED.search(line))
    ]
    assert not found


def descriptions(text):
    """Yield the first lines of docstrings of modules, classes and attributes, and of numpydoc entries."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        for part in body if isinstance(body, list) else ():
            if not (isinstance(part, ast.Expr) and isinstance(part.value, ast.Constant)):
                continue
            if isinstance(part.value.value, str):
                lines = part.value.value.splitlines()
                first = [] if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) else [0]
                entries = [n for n, line in enumerate(lines) if re.match(r" *\*{0,2}[\w, ]+ : ", line)]
                for number in first + [n + 1 for n in entries if n + 1 < len(lines)]:
                    yield part.lineno + number, lines[number].strip()


@pytest.mark.parametrize("folder", SOURCES)
def test_things_are_described_by_what_they_are_and_not_by_a_question(folder):
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line}"
        for path in sorted((ROOT / folder).rglob("*.py"))
        for number, line in descriptions(path.read_text(encoding="utf-8"))
        if re.match(r"(What|How|Where|Who|Which|Why|When|That)\b", line)
    ]
    assert not found


def is_property(function):
    """Return whether a function is read as an attribute: it may be described by a noun."""
    return any("property" in ast.unparse(decorator) for decorator in function.decorator_list)


@pytest.mark.parametrize("folder", SOURCES)
def test_docstrings_of_functions_begin_with_a_verb_in_the_imperative(folder):
    found = [
        f"{path.relative_to(ROOT)}:{node.lineno}: {first[0]}"
        for path in sorted((ROOT / folder).rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        and (text := ast.get_docstring(node))
        and (first := (OF_PROPERTIES if is_property(node) else FIRST_WORDS).match(text))
    ]
    assert not found
