"""Compilation of generated source and of loops to machine code, its calls, cache and build."""
