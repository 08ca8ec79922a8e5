"""`python -m khepera_emulator.cli`."""

from khepera_emulator.cli import main

if __name__ == "__main__":
    main()
