"""What loops ask of the compiled series of a model."""

#: Order of the short series.
SHORT = 4

#: What a mode and so many times the number of all modes ask for: the short series, the rates
#: alone, and the derivative of the rates in a direction.
SHORTENED, RATES, DIRECTIONAL = 1, 2, 3


#: Highest degree of the collocation polynomials that take the place of a Taylor series.
COLLOCATION = 12
