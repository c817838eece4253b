"""How any curve F(u) = 0 is traced; knows no model."""
