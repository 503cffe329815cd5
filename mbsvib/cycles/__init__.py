"""Running machines: inverse dynamics over a prescribed motion, shaking force and moment, reactions, gradients."""
