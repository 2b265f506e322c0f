from coursekit.slam.association import *
