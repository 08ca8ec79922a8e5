"""Numbers of hostile inputs: how many a test tries, and how many have been tried."""

import os
from collections import Counter

LONGER = 40
"""Times as many inputs in the long form."""


class Hostile:
    """The number of inputs to try, and of those that were tried."""

    def __init__(self) -> None:
        self.long = os.environ.get("HOSTILE_LONG") == "1"
        self.tried: Counter[str] = Counter()

    def examples(self, number: int) -> int:
        return number * LONGER if self.long else number

    def count(self, edge: str, number: int = 1) -> None:
        self.tried[edge] += number
