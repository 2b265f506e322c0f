from coursekit.labs.lab09.localisation import *
