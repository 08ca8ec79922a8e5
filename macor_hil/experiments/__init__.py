"""The paper's experiments: one file each, run over many seeds and reported beside the paper."""
