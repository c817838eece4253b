"""Special points of periodic orbits, their normal forms and curves in two parameters."""
