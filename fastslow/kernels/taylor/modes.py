"""Mode numbers by which loops request parts of the compiled series of a model."""

#: Order of the short series.
SHORT_ORDER = 4

#: Multiples of the number of modes that are added to a mode to request the short series, the
#: rates alone, and the directional derivative of the rates.
SHORTENED, RATES, DIRECTIONAL = 1, 2, 3


#: Highest degree of the collocation polynomials that replace a Taylor series.
COLLOCATION = 12
