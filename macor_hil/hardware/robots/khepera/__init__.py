"""The Khepera: how it looks from outside, and what passes on its line."""
