"""Other poses: bodies moved by finite joint motions with loops closed, and the pose or the preloads of equilibrium."""
