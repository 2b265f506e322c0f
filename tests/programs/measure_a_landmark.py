"""From the corners of a picture's cylinder to range and bearing."""

from coursekit import Camera, Rejected, measure, range_bearing

camera = Camera(fx=500.0, fy=500.0, cx=319.5, cy=239.5, width=640, height=480)
seen = measure([[300, 100], [340, 100], (340, 300), (300, 300)], camera)
assert not isinstance(seen, Rejected)
distance, bearing = range_bearing(seen.height_px, seen.axis_px, camera, landmark_height=0.5)
assert abs(distance - 1.25) < 0.01 and abs(bearing) < 0.01
assert not measure([[0, 100], [40, 100]], camera)
