"""The wheels measured: courses driven, distances taken, results."""
