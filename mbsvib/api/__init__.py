"""The public classes: models, systems and batches with all of their methods."""
