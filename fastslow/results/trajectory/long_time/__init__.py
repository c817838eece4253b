"""Long-time behaviour: periodicity, sections, spectra, exponents, regimes, sweeps."""
