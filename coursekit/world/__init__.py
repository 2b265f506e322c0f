"""The 2-D world: arena, robot, sensors, pilot, recorder.

Deterministic for a seed; it never imports an estimator.
"""
