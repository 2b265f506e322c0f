"""How much a student's code may take."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """seconds : for an exercise.  project_seconds : for all runs of a project.  memory, file_size : in MB."""

    seconds: float = 10.0
    project_seconds: float = 300.0
    memory: int = 1000
    file_size: int = 10
