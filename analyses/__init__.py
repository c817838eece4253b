"""The figures of the harmonic gear, each by a script of its own; `python -m analyses` runs all.

The source of the cases is M. Ding, Current Journal of Applied Science and
Technology 42(7), 66-75, 2023, doi 10.9734/CJAST/2023/v42i74082. It gives no
frequency of the load, no initial state and no time span; here the load has
ω_o = 0.01, and three of its periods are run from rest.
"""
