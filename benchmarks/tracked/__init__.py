"""Benchmarks that asv runs for each commit."""

import sys
from pathlib import Path

# asv puts this folder alone on the path; what is measured stands beside it
sys.path.insert(0, str(Path(__file__).parent.parent))
