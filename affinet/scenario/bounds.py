"""How small and how large the numbers of a scenario, or of a command line, may be.

In SI units nothing that flies is measured in less than a billionth, or in more than a billion; within these bounds squares and
quotients of what a scenario says are far from where floats vanish and overflow, and counts from where integers wrap.
"""

from __future__ import annotations

SMALLEST, LARGEST = 1e-9, 1e9
LATEST = 1e11  # s: a clock on the wall says 1.7e9
MOST = 10**9
