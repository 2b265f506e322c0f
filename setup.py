"""What pyproject.toml cannot say: the wheel carries data/ as coursekit/data, so that every lab runs from it."""

from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py


class WithData(build_py):
    """The package and the project's data; an editable installation reads the checkout's own folder."""

    def run(self) -> None:
        super().run()
        if not self.editable_mode:
            self.copy_tree("data", str(Path(self.build_lib, "coursekit", "data")))


setup(cmdclass={"build_py": WithData})
