"""A rehearsal of the labs, beside nbmake: ``pytest -p tests.rehearsal --nbmake notebooks``.

nbmake alone passes a lab whose slider raises, or whose own solution fails its check.  In a rehearsed kernel each
explorer is swept when it is declared, live and in pictures, and a check or a score that a solution does not pass
raises, in the cell that asked for it.
"""

import functools
import os
import tempfile
from pathlib import Path

from coursekit.teaching import exercises, explore

ROOT = Path(__file__).parent.parent
STARTUP = "from tests import rehearsal\nrehearsal.begin()\n"
LARGEST = 200  # pictures of an explorer; more would make a page too heavy to publish
PASSING = 80  # marks of a lab's own project


def pytest_configure(config):
    """Give each kernel that this session starts the rehearsal's start-up file."""
    folder = tempfile.TemporaryDirectory(prefix="rehearsal")
    config.add_cleanup(folder.cleanup)
    startup = Path(folder.name, "profile_default", "startup")
    startup.mkdir(parents=True)
    (startup / "rehearsal.py").write_text(STARTUP, encoding="utf-8")
    os.environ["IPYTHONDIR"] = folder.name
    os.environ["PYTHONPATH"] = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])


def begin():
    """Make explorers, checks and scores of this kernel strict."""
    explore.explore = _strict(explore.explore, faults)
    exercises.check = _strict(exercises.check, lambda verdict: [] if verdict else [repr(verdict)])
    exercises.score = _strict(exercises.score, lambda score: [] if score.mark >= PASSING else [repr(score)])


def _strict(make, problems):
    @functools.wraps(make)
    def made(*args, **kwargs):
        result = make(*args, **kwargs)
        if found := problems(result):
            raise AssertionError("\n".join(found))
        return result

    return made


def faults(explorer):
    """What is wrong with an explorer, in sentences: in its pictures, its live form, or its size."""
    if len(explorer) > LARGEST:
        return [f"{explorer!r}: more than {LARGEST}"]
    found = explore.sweep(explorer)
    sliders = list(explorer.parameters.values())
    start = [slider.values.index(slider.start) for slider in sliders]
    pictures = set()
    for i, slider in enumerate(sliders):
        for position in range(len(slider.values)):
            said, shown = explorer.widget().answer([*start[:i], position, *start[i + 1 :]])
            pictures.update(shown)
            if "error" in said:
                found.append(f"{explorer!r}, live, {said['error']} at position {position} of control {i}")
    if len(pictures) < 2:
        found.append(f"{explorer!r}: its live form never changes")
    explorer.close()
    return found
