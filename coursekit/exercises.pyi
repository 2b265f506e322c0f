from coursekit.teaching.exercises import *
