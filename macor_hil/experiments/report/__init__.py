"""The parts of a report: blocks of a page, drawings, statistics."""
