"""Programs as a user writes them, with lists and tuples: they run with NumPy and SciPy alone, and type checkers agree.

``tests/test_programs.py`` runs and checks them; ``make test-wheel`` runs them with the wheel in a bare environment.
"""
