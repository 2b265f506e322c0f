"""The labs' notebooks: each lab's own, and the second ones that go further."""

from pathlib import Path

FOLDER = Path(__file__).parent.parent / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("[0-9][0-9]_*.ipynb"))
OPTIONAL = sorted(FOLDER.glob("[0-9][0-9][a-z]_*.ipynb"))
