"""The one reader of formulas given as text: equations, conditions, queries, sections and axes.

A formula holds

- names: identifiers of any script, compared as Python compares them (NFKC: ``ℌ`` is ``H``);
  a name that is no identifier, such as ``x - D``, is read only where it stands alone;
- decimal numbers: ``2``, ``.5``, ``1e-3``;
- ``+``, ``-``, ``*``, ``/`` and the power ``**``, which bind as in Python;
- functions by their names in SymPy, and ``abs``, ``max``, ``arctan`` and the like;
- within ``Piecewise((value, condition), …)`` and where a condition is expected, comparisons
  (chained ones too), ``&``, ``|``, ``~``, ``and``, ``or``, ``not``, ``True`` and ``False``.

Everything else is refused: strings, attributes, subscripts, assignments, keyword arguments,
comprehensions, ``lambda``, comments, complex, hexadecimal and underscored numbers, ``//``,
``%`` and ``^``. Nothing is ever run: the text becomes a tree of the few nodes in
`fastslow.formulas.grammar`, and NumPy, SymPy and the labels of axes see that tree alone. The
limits on length, nesting, numbers and exponents are in `fastslow.formulas.limits`.
"""
