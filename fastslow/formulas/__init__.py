"""The parser of all formulas given as text: equations, conditions, queries, sections and axes.

A formula consists of

- names: identifiers of any script, normalised as in Python (NFKC: ``ℌ`` is ``H``); a name
  that is not an identifier, such as ``x - D``, is recognised only as a whole formula;
- decimal numbers: ``2``, ``.5``, ``1e-3``;
- ``+``, ``-``, ``*``, ``/`` and the power ``**``, with the precedence of Python;
- functions by their names in SymPy, and aliases such as ``abs``, ``max`` and ``arctan``;
- in ``Piecewise((value, condition), …)`` and conditions, comparisons (also chained), ``&``,
  ``|``, ``~``, ``and``, ``or``, ``not``, ``True`` and ``False``.

All other syntax is rejected: strings, attributes, subscripts, assignments, keyword arguments,
comprehensions, ``lambda``, comments, complex, hexadecimal and underscored numbers, ``//``,
``%`` and ``^``. No text is ever executed: it is parsed to a tree of the nodes in
`fastslow.formulas.grammar`, from which values, SymPy expressions and labels are built. The
limits on length, nesting, numbers and exponents are in `fastslow.formulas.limits`.
"""
