"""The part of SciPy that the checks of the exercises use, written in NumPy.

It goes with the checks to the reader's browser, where SciPy itself would be a download of 13 MB.  Each function takes
the arguments that the course gives it, and no others; tests compare it with SciPy.
"""
