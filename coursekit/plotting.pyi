from coursekit.teaching.plotting import *
