"""The serial protocol of the Khepera as pure values: bytes in, requests and replies out."""
