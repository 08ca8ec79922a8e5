"""Parts of reports: elements of a page, drawings, statistics."""
