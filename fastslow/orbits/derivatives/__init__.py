"""Derivatives of runs and orbits: sensitivities, gradients, Lyapunov exponents."""
