"""The same scenes through mbsvib, the traditional method and other libraries; ``benchmarks/compare.py`` runs them."""

import os

# Here because it has to be before numpy is imported: one thread, so that CPU time is run time.
for _variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")
