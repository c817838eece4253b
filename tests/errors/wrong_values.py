"""Rows of wrong values that several arguments share."""

import numpy as np

import fastslow as fs

NAN, INF = float("nan"), float("inf")
Wrong, Unknown, BadModel = fs.ArgumentError, fs.UnknownNameError, fs.ModelError

FLAG = [(NAN, Wrong, "nan; expected True or False"), (1, Wrong, "= 1; expected True or False")]
NUMBER = [
    (NAN, Wrong, "nan; expected a finite number"),
    ("5", Wrong, "'5'; expected a finite number"),
    (True, Wrong, "True; expected a finite number"),
    ([1.0], Wrong, "[1.0]; expected a finite number"),
]
POSITIVE = [
    (0, Wrong, "0; expected a positive number"),
    (-1, Wrong, "-1; expected a positive number"),
    (INF, Wrong, "inf; expected a positive number"),
    ("5", Wrong, "'5'; expected a positive number"),
]
TOLERANCE = [*POSITIVE, (1.0, Wrong, "1.0; expected a number from 1e-16 to 0.1")]
COUNT = [
    (-1, Wrong, "-1; expected"),
    (1.5, Wrong, "1.5; expected an integer"),
    (True, Wrong, "True; expected an integer"),
    ("3", Wrong, "'3'; expected an integer"),
]
TEXT = [(3, Wrong, "3; expected text")]
SYMBOL = [(2.5, Wrong, "2.5; expected a name or an expression")]
MAPPING = [([1], Wrong, "[1]; expected a mapping"), ("x", Wrong, "'x'; expected a mapping")]
PATH = [
    ("", Wrong, "path = ''; expected the path of a file"),
    (3, Wrong, "path = 3; expected the path of a file"),
]
SAVE = [
    *PATH,
    ("gear.csv", Wrong, "gear.csv: expected a name that ends in .npz or .nc"),
    ("nowhere/gear.npz", fs.FileError, "nowhere/gear.npz cannot be written: No such file"),
]
FIGURE = [
    *PATH,
    ("gear.pgn", Unknown, "unknown figure format 'pgn'; did you mean 'png'?"),
    ("nowhere/gear.pdf", fs.FileError, "nowhere/gear.pdf cannot be written: No such file"),
]
RANGE = [
    ((1, 1), Wrong, "(1, 1); expected two finite numbers, the lower one first"),
    ((2, -1), Wrong, "the lower one first; did you mean (-1, 2)?"),
    ((0, INF), Wrong, "(0, inf); expected two finite numbers"),
    ((0, NAN), Wrong, "(0, nan); expected two finite numbers"),
    ((0, 1, 2), Wrong, "(0, 1, 2); expected two finite numbers"),
    (("0", "1"), Wrong, "('0', '1'); expected two finite numbers"),
    (3, Wrong, "3; expected two finite numbers"),
]
PLANE = [
    (3, Wrong, "over = 3; expected a mapping"),
    ({"C": (0, 1)}, Wrong, "over"),
    ({"C": (1, 0), "D": (0, 1)}, Wrong, "over"),
]
COLUMN = [("omga", Unknown, "omga"), ("x +", Wrong, "'x +' is not an expression")]
NAME = [("omga", Unknown, "unknown"), (None, Unknown, "None")]


def a(kind):
    """Rows for an argument that is an object of a class."""
    article = "an" if kind[0] in "AEIO" else "a"
    return [
        (None, Wrong, f"expected {article} {kind}, received None"),
        ("omga", Wrong, f"expected {article} {kind}, received a str"),
        (np.zeros(3), Wrong, f"expected {article} {kind}, received an ndarray"),
    ]
