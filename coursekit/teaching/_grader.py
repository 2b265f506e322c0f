"""Whether a notebook runs in a grader that goes by exceptions, as nbgrader does: there, "not yet" is an error."""

import os

# nbgrader sets the first while it validates or autogrades; the second is for any other grader of that kind.
VARIABLES = ("NBGRADER_EXECUTION", "COURSEKIT_GRADING")


def in_a_grader() -> bool:
    """Whether one of ``VARIABLES`` is set."""
    return any(os.environ.get(variable) for variable in VARIABLES)
