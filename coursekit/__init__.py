"""coursekit: the tested support package of *Where Am I? Robot localisation and mapping, lab by lab*.

One lab, one module; see the README for the house and ``notebooks/`` for the labs.
"""

__version__ = "0.1.0"
