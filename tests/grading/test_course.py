import pytest

from ciberrato.grading.course import CourseError, read_course
from ciberrato.grading.task import tasks_of
from tests.grading.agents import ROBOT, table, write
from tests.grading.program import run

LAB = "[[lab]]\nname = 'maze'\n"

AGENT = "[[agent]]\nname = 'x'\ncommand = 'x'\n"


@pytest.fixture
def good(tmp_path):
    write(tmp_path, "one", ROBOT)
    return LAB + table("one")


def faults(tmp_path, text):
    path = tmp_path / "course.toml"
    path.write_text(text)
    with pytest.raises(CourseError) as caught:
        read_course(path)
    return caught.value.faults


def test_a_course_is_read_with_its_defaults(tmp_path, good):
    path = tmp_path / "course.toml"
    path.write_text(good)
    course = read_course(path)
    assert (course.seeds, course.lockstep, course.labs[0].weight) == ((1,), True, 1.0)
    assert course.labs[0].lab.name == "maze_lab.xml"
    assert course.points.formula.text == "merit"
    assert course.agents[0].command == ("python", "agent.py", "{host}", "{port}", "{name}")


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("seeds = 0\n", "seeds: a list of whole numbers"),
        ("seeds = [1, 1]\n", "a seed occurs more than once"),
        ("seeds = [9223372036854775808]\n", "seeds: a list of whole numbers from 0 to 9223372036854775807"),
        ("[limits]\nfiles = 99999999999999999999\n", "limits: files: a whole number from 1 to 1e+09"),
        ("pace = 'fast'\n", "pace: one of lockstep, realtime"),
        ("speed = -1\n", "speed: a number from 0.01"),
        ("colour = 1\n", "unknown entry 'colour'; the entries are:"),
        ("points = 3\n", "points: a table was expected"),
        ("[points]\nformula = 'skore'\n", "unknown name 'skore'; the names are:"),
        ("[limits]\nmemory = 'much'\n", "limits: memory: a whole number from 1"),
        ("[limits]\nmemori = 1\n", "limits: unknown entry 'memori'"),
        ("readable = ['nowhere']\n", "readable: there is no "),
    ],
)
def test_each_fault_is_a_line_that_names_its_place(tmp_path, good, text, what):
    found = faults(tmp_path, text + good)
    assert len(found) == 1
    assert what in found[0]
    assert found[0].startswith(str(tmp_path / "course.toml"))
    assert "\n" not in found[0]


@pytest.mark.parametrize(
    ("text", "what"),
    [
        (LAB, "agent: at least one is needed: [[agent]]"),
        (LAB + "[[agent]]\nname = 'x'\n", "agent 1 (x): command: is missing"),
        (LAB + "[[agent]]\ncommand = 'x'\n", "agent 1: name: is missing"),
        (LAB + "[[agent]]\nname = 'x'\ncommand = 'x {hots}'\n", "these can be filled in: {host}"),
        (LAB + "[[agent]]\nname = 'x'\ncommand = \"x 'y\"\n", "No closing quotation"),
        (LAB + "[[agent]]\nname = 'x'\ncommand = 'x'\nfolder = 'nowhere'\n", "there is no folder "),
        (LAB + "[[agent]]\nname = 'x'\ncommand = 'x'\nfolder = '.'\n", "holds the course itself"),
        (LAB + "[[agent]]\nname = 'x'\ncommand = 'x'\nbuild = 'make'\n", "build: needs a folder"),
        (LAB + 2 * "[[agent]]\nname = 'x'\ncommand = 'x'\n", "'x' occurs more than once"),
        (
            "[[lab]]\nname = 'mase'\n[[agent]]\nname = 'x'\ncommand = 'x'\n",
            "neither a file nor a lab that ships",
        ),
        (LAB + "scoring = 8\n[[agent]]\nname = 'x'\ncommand = 'x'\n", "scoring: a whole number from 0 to 7"),
        (LAB + "set = {SimTim = 1}\n[[agent]]\nname = 'x'\ncommand = 'x'\n", "SimTim"),
        (LAB + "weight = 0\n[[agent]]\nname = 'x'\ncommand = 'x'\n", "no weight is greater than 0"),
        (
            LAB + "[[agent]]\nname = 'x'\ncommand = 'x'\nenvironment = {'A=B' = 1}\n",
            "environment: 'A=B' cannot be set",
        ),
        (
            LAB + "[[agent]]\nname = 'x'\ncommand = 'x'\nenvironment = {'' = 1}\n",
            "environment: '' cannot be set",
        ),
        (LAB + '[[agent]]\nname = "x"\ncommand = "x"\nenvironment = {A = "\\u0000"}\n', "cannot be set to"),
        (LAB + AGENT + "folder = '" + 5000 * "y" + "'\n", "there is no folder"),
        (
            "[[lab]]\nname = 'm'\nlab = '" + 5000 * "y" + "'\n" + AGENT,
            "neither a file nor a lab",
        ),
        (LAB + "set = {SimTime = 0}\n" + AGENT, "a run of a course has to end"),
        (
            LAB + "position = 77\n" + AGENT,
            "position: the start grid has places 1 to",
        ),
        ("seeds = = 1", "not TOML"),
    ],
)
def test_faults_of_labs_and_agents(tmp_path, text, what):
    (found,) = faults(tmp_path, text)
    assert what in found


def test_the_program_says_each_fault_and_ends_with_status_2(tmp_path, good):
    path = tmp_path / "course.toml"
    path.write_text("seeds = 0\npace = 'fast'\n" + good)
    done = run(path, expect=2)
    lines = done.stderr.splitlines()
    assert len(lines) == 2
    assert all(line.startswith(f"ciberrato-grade: {path}: ") for line in lines)
    assert not (tmp_path / "course-report").exists()
    assert "no such file" in run(tmp_path / "none.toml", expect=2).stderr


def test_a_runs_key_changes_with_all_that_decides_it_and_with_nothing_else(tmp_path, good):
    path = tmp_path / "course.toml"

    def key(text):
        path.write_text(text)
        return tasks_of(read_course(path))[0].key

    before = key(good)
    assert key("title = 'Another'\n[points]\nformula = '2 * score'\n" + good) == before
    assert key(good.replace("name = 'maze'", "name = 'maze'\nweight = 3")) == before
    changed = {
        key("pace = 'realtime'\n" + good),
        key("[limits]\nmemory = 7\n" + good),
        key(good.replace("name = 'maze'", "name = 'maze'\nset = {SimTime = 7}")),
        key(good.replace("name = 'maze'", "name = 'maze'\nscoring = 1")),
        key(good.replace("{port}", "{port} -v")),
    }
    write(tmp_path, "one", ROBOT + "# changed\n")
    changed.add(key(good))
    assert len(changed) == 6
    assert before not in changed
