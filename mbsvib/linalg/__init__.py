"""Linear algebra of plain arrays: products of factors, rotations, double-double arithmetic, matching of shapes."""
