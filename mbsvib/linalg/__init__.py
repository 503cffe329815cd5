"""Linear algebra of plain arrays: products of factors, rotations, sums to twice the digits, matching of shapes."""
