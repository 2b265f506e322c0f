"""The 2-D world: arena, robot, sensors, pilot and recorder.  Deterministic for a seed; it never imports an estimator."""
