"""`python -m khepera_emulator.app.cli`."""

from khepera_emulator.app.cli import main

if __name__ == "__main__":
    main()
