"""Submissions with sins, and what each deserves: two exercises of lab 4, the first of them handed in with a sin.

Each sin is the code of the cell that should define ``innovation``, or of a cell of its own, and what the student is
told.  The second exercise is right in every one of them, and must earn its point.
"""

from dataclasses import dataclass

IMPORTS = "import numpy as np\n\nfrom coursekit import exercises\nfrom coursekit.geometry import wrap_angle"
RIGHT = """def innovation(z, z_hat):
    return np.array([z[0] - z_hat[0], wrap_angle(z[1] - z_hat[1])])"""
SECOND = "def predict_covariance(P, F, Q):\n    return F @ P @ F.T + Q"
CHECKS = (
    'exercises.check("lab04.innovation", innovation)',
    'exercises.check("lab04.predict_covariance", predict_covariance)',
)
WRONG = "def innovation(z, z_hat):\n    return z - z_hat"  # not wrapped


@dataclass(frozen=True)
class Sin:
    """cells : of the notebook.  points : for the first exercise.  told : a piece of what its student reads."""

    cells: tuple[str, ...]
    points: float = 0.0
    told: str = ""
    second: float = 1.0


def inside(lines: str) -> tuple[str, ...]:
    """A right function that sins on its way."""
    first, last = RIGHT.split("\n")
    body = "\n".join("    " + line for line in lines.split("\n"))
    return (IMPORTS, f"{first}\n{body}\n{last}", SECOND, *CHECKS)


def before(cell: str, answer: str = WRONG) -> tuple[str, ...]:
    """A cell that is run first, and a wrong answer that it is meant to rescue."""
    return (IMPORTS, cell, answer, SECOND, *CHECKS)


# What an instructor's first fourteen submissions did.
FIRST = {
    "loops for ever": Sin(inside("while True:\n    pass"), 0, "had not finished"),
    "eats memory": Sin(inside("block = bytearray(10**10)"), 0, "MemoryError"),
    "prints 200 MB": Sin(inside("for _ in range(20):\n    print('x' * 10**7)"), 1),
    "kills its kernel": Sin(inside("import os, signal\nos.kill(os.getpid(), signal.SIGKILL)"), 0, "signals"),
    "ends without an error": Sin(inside("import os\nos._exit(0)"), 0, "ended the process"),
    "writes outside": Sin(inside("open(FILE, 'w').write('here')"), 0, "own folder only"),
    "opens a connection": Sin(
        inside("import socket\nsocket.create_connection(('127.0.0.1', PORT), 1)"), 0, "connection"
    ),
    "deletes the cell of its answer": Sin((IMPORTS, SECOND, *CHECKS), 0, "renamed, or its cell deleted"),
    "renames the function": Sin((IMPORTS, RIGHT.replace("innovation", "mine"), SECOND, CHECKS[1]), 0, "renamed"),
    "redefines check": Sin(
        before("exercises.check = lambda *_: exercises.Verdict('lab04.innovation', True)"), 0, "whole turn"
    ),
    "empties the checks": Sin(
        before(
            "names = exercises.names()\nfor name in names:\n    exercises._checks[name] = lambda answer, rng: None",
            WRONG + "\n\ninnovation.needs = exercises._checks, names",
        ),
        0,
        "whole turn",
    ),
    "prints a verdict": Sin(inside('print(\'{"share": 1.0, "said": []}\', flush=True)\nreturn z'), 0, "wrap_angle"),
    "is not Python": Sin((IMPORTS, "def innovation(z, z_hat)\n    return z", SECOND, *CHECKS), 0, "renamed"),
    "is empty": Sin(
        (IMPORTS, 'def innovation(z, z_hat):\n    raise NotImplementedError("your lines here")', SECOND),
        0,
        "Nothing here yet",
    ),
}

# And what else could go wrong.
FURTHER = {
    "sleeps": Sin(inside("import time\ntime.sleep(10**6)"), 0, "had not finished"),
    "loops while it is defined": Sin(
        before("import time\nwhile True:\n    k = time.sleep(0.01)", WRONG.replace("z -", "k + z -")),
        0,
        "had not finished",
    ),
    "loops in a cell that nobody needs": Sin(before("while True:\n    print('x')", RIGHT), 1),
    "swallows whatever stops it": Sin(
        inside("import time\nwhile True:\n    try:\n        time.sleep(0.01)\n    except BaseException:\n        pass"),
        0,
        "had not finished",
    ),
    "kills its parent and all others": Sin(
        inside(
            "import os\nfor pid in (os.getppid(), -1):\n    try:\n        os.kill(pid, 9)\n"
            "    except OSError:\n        pass"
        ),
        1,
    ),
    "starts a program": Sin(inside("import subprocess\nsubprocess.run(['true'])"), 0, "another program"),
    "crashes the interpreter": Sin(inside("import ctypes\nctypes.string_at(0)"), 0, "ended the process"),
    "raises SystemExit": Sin(inside("raise SystemExit"), 0, "SystemExit"),
    "reads the solved lab": Sin(inside("open(SOLVED).read()"), 0, "PermissionError"),
    "answers with more than a message holds": Sin(inside("return np.zeros(3 * 10**6)"), 0, "ended the process"),
    "answers with an object that equals everything": Sin(
        before(
            "class Yes:\n    def __eq__(self, other):\n        return True",
            "def innovation(z, z_hat):\n    return Yes()",
        ),
        0,
        "got Yes",
    ),
    "writes into the judge's line": Sin(
        inside(
            "import os\nfor handle in range(3, 200):\n    try:\n        os.write(handle, b'{\"share\": 1.0}')\n"
            "    except OSError:\n        pass"
        ),
        0,
        "ended the process",
    ),
    "replaces what compares": Sin(
        before(
            "import coursekit.teaching.exercises as e\ne.close = e.expect = e.near = lambda *_, **__: True",
            WRONG + "\n\ninnovation.needs = e",
        ),
        0,
        "whole turn",
    ),
    "looks for the truth in its callers": Sin(
        inside(
            "import sys\nframe, found = sys._getframe(), set()\nwhile frame:\n"
            "    found |= {*frame.f_locals} & {'rng', 'seed'}\n    frame = frame.f_back\nif not found:\n    return z"
        ),
        0,
        "wrap_angle",
    ),
    "imports what is not installed": Sin(before("import robotics_of_2040", RIGHT), 1),
    "lost its imports": Sin((RIGHT, SECOND, *CHECKS), 1),
    "renames the function, and says so in its check": Sin(
        (IMPORTS, RIGHT.replace("innovation", "mine"), SECOND, CHECKS[0].replace(", innovation", ", mine"), CHECKS[1]),
        1,
    ),
    "uses IPython's own lines": Sin(
        before("%matplotlib inline\n!ls\nk = 0", RIGHT.replace("return", "display(k)\n    return")), 1
    ),
    "defines it twice": Sin(before(WRONG, RIGHT), 1),
    "leaves a process behind": Sin(
        inside("import os\nif os.fork() == 0:\n    os.setsid()\n    while True:\n        pass"), 0, "another program"
    ),
    "fills its folder": Sin(inside("with open('mine', 'wb') as file:\n    file.write(bytes(10**8))"), 0, "OSError"),
    "changes what it is given": Sin(inside("z[0] = 0.0"), 0, "in place"),
}
