"""Which landmark of a known map was that?"""

from coursekit import Gaussian, JointCompatibility, Mahalanobis
from coursekit.association import KnownMap

tags = KnownMap({6: [2.0, 0.0], 7: (0.0, 2.5)})
pose = Gaussian([0.1, 0.0, 0.0], [[0.04, 0, 0], [0, 0.04, 0], [0, 0, 0.01]])
for rule in (Mahalanobis(0.99), JointCompatibility(0.99)):
    found = tags.match(pose, [[1.9, 0.0]], [[0.0025, 0], [0, 0.0001]], rule)
    assert tags.ids[found.rows[0]] == 6
