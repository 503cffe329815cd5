"""Random vibration: mean squares under noise, error budgets, and their derivatives."""
