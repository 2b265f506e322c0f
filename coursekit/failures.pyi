from coursekit.teaching.failures import *
