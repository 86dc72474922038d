"""affinet: a scenario in, a run out."""

import os

# BLAS rounds otherwise when it shares large matrices out to threads, and agents' processes have one each. It looks at this when
# NumPy is imported.
os.environ["OPENBLAS_NUM_THREADS"] = "1"
