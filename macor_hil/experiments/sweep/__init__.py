"""An experiment over many seeds: jobs, engines, pages of its report."""
