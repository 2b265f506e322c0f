from coursekit.teaching.experiments import *
