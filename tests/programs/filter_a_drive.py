"""An extended Kalman filter: drive, look at a landmark, ask whether the answer was a surprise."""

from coursekit import DifferentialDrive, Gaussian, Position, RangeBearing, chi2_band, ekf, nees

belief = Gaussian([0.0, 0.0, 0.0], [[0.01, 0.0, 0.0], [0.0, 0.01, 0.0], [0.0, 0.0, 0.0025]])
landmark = RangeBearing([2.0, 1.0], R=[[0.0025, 0.0], [0.0, 0.0004]])
for control in ([0.5, 0.0], (0.5, 0.2)):
    belief = ekf.predict(belief, DifferentialDrive(), control, 0.1)
seen = ekf.correct(belief, landmark, [2.1, 0.45])
fixed = ekf.correct(seen.belief, Position(), (0.1, 0.0), R=[[0.04, 0], [0, 0.04]])
moments = ekf.correct_together(fixed.belief, [landmark, landmark], [[2.1, 0.45], [2.12, 0.44]])
assert seen.nis < chi2_band(2, confidence=0.999)[1]
assert nees(moments.belief, [0.1, 0.0, 0.0]) > 0.0
