"""How large a formula may be, with the reason for each limit."""

from __future__ import annotations

#: Characters of a formula. Derived expressions that SymPy prints reach some ten thousand; a
#: text of this length is read in a fraction of a second.
LENGTH = 20_000

#: Levels of nesting; a bracket, a function, and an operator that binds more tightly than the
#: one before it open one each. Python's own stack, of 1000 calls, is safe in every use.
DEPTH = 64

#: Characters of a number. Exact numbers of SymPy have some hundreds of digits.
DIGITS = 400

#: Pieces of a Piecewise.
PIECES = 32

#: Arguments of Max and Min, which SymPy compares with one another, pair by pair.
ARGUMENTS = 12

#: Size of an exponent without names, and the degree of powers of powers, where SymPy is to
#: expand a formula.
EXPONENT = 64

#: Size of a number that a special function is given, where SymPy would write its value out.
ARGUMENT = 64.0

#: Total degree of a polynomial along the steps of a run, each of which is a polynomial itself.
DEGREE = 8
