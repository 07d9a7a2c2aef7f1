"""What cyclictest says is read as its counts have it."""

import numpy as np

from benchmarks.cyclictest import Latencies

SAID = """# /dev/cpu_dma_latency set to 0us
# Histogram
000000 000000
000001 000989
000002 000009
000003 000001
# Total: 000000999
# Min Latencies: 00001
# Avg Latencies: 00001
# Max Latencies: 12169
# Histogram Overflows: 00001
# Histogram Overflow at cycle number:
# Thread 0: 00042
"""


def test_its_latencies_are_counted() -> None:
    found = Latencies(SAID)
    assert found.wakings == 1000
    assert [found.later_than(us * 1e-6) for us in (0.5, 1.5, 2.5, 3.5)] == [1000, 11, 2, 1]
    assert found.quantiles() == {"p50": 1e-6, "p99": 2e-6, "p99.9": 3e-6, "max": 12169e-6}
    numbers = np.repeat([1, 2, 3, 12169], [989, 9, 1, 1])
    exact = np.quantile(numbers, [0.5, 0.99, 0.999], method="inverted_cdf")
    assert np.allclose([*found.quantiles().values()][:3], exact * 1e-6)
