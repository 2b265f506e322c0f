from coursekit.teaching.explore import *
