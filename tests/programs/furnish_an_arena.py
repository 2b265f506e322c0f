"""An arena from lists, saved and read back; only who drives in it needs the extra ``world``."""

from pathlib import Path
from tempfile import TemporaryDirectory

from coursekit import Arena
from coursekit.world.arena import Crate, Cylinder, Tag, Wall

yard = Arena(
    "yard",
    walls=[Wall([0, 0], [4, 0])],
    cylinders=[Cylinder([3, 0.5], colour="red")],
    crates=[Crate([1.0, 2.0, 0.1], size=[0.3, 0.4])],
    tags=[Tag(6, [2.0, 1.0], yaw=3.1)],
    start=[1, 0.5, 0],
)
with TemporaryDirectory() as folder:
    yard.save(Path(folder) / "yard.toml")
    assert Arena.load(Path(folder) / "yard.toml") == yard
