"""Random tests try the same examples in every run, so that a failure is there again tomorrow."""

from hypothesis import HealthCheck, Phase, settings

settings.register_profile(
    "same", deadline=None, derandomize=True, database=None, max_examples=40,
    # a mechanism that is made from a seed doesn't shrink to a simpler one
    phases=[Phase.explicit, Phase.generate],
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)  # fmt: skip
settings.load_profile("same")
