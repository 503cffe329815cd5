"""Rolling wheels: steady forward motion, contact conditions, and the first-order equations of deviations from it."""
