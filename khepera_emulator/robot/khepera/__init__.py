"""The Khepera and the Khepera II: wheels with encoders, the ROM's protocol and tools, turrets."""
