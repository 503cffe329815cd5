"""Hubs: what turns steadily."""
