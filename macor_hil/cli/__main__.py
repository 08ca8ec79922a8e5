"""`python -m macor_hil.cli`."""

from macor_hil.cli import main

if __name__ == "__main__":
    main()
