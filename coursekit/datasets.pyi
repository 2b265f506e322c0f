from coursekit.recordings.datasets import *
