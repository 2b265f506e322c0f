"""What each lab computes, draws, asks and breaks, one folder a lab; the same file names in each.

``runs``       the lab's settings, drives and experiments: what is computed
``figures``    its still pictures
``explorers``  its scenes behind sliders: each builds its figure once and then moves the artists
``exercises``  the checks of its exercises
``failures``   its failures: classic mistakes, each beside the check that catches it

No lab needs all of them, and none imports another lab.
"""
