"""Limits on the size of formulas, with the reason for each."""

from __future__ import annotations

#: Characters of a formula. Derived expressions printed by SymPy reach some ten thousand; a
#: text of this length is parsed in a fraction of a second.
LENGTH = 20_000

#: Levels of nesting: brackets, functions and operators of higher precedence than the previous
#: one. Python's recursion limit of 1000 is not reached.
DEPTH = 64

#: Characters of a number. Exact numbers of SymPy have some hundreds of digits.
NUMBER_CHARACTERS = 400

#: Pieces of a Piecewise.
PIECES = 32

#: Arguments of Max and Min, which SymPy compares pairwise.
ARGUMENTS = 12

#: Size of a numerical exponent, and degree of nested powers, in formulas expanded by SymPy.
EXPONENT = 64

#: Size of a numerical argument of a special function that SymPy would evaluate exactly.
ARGUMENT = 64.0

#: Total degree of a polynomial in columns along the steps of a run.
COLUMNS_DEGREE = 8
