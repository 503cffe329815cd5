"""``python -m mbsvib`` is the command line."""

from mbsvib.cli import main

if __name__ == "__main__":
    main()
