"""Every run draws the same examples, and no test has a deadline: a busy machine is not a wrong answer.

``--hypothesis-profile=fresh`` draws new ones.
"""

from hypothesis import settings

settings.register_profile("course", deadline=None, derandomize=True)
settings.register_profile("fresh", deadline=None)
settings.load_profile("course")
