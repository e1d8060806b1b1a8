"""One thread per numerical library, before any is loaded: the matrices are small, and threads only get in each other's
way."""

import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
