"""`python -m placerec` is `placerec`."""

from placerec.cli import main

if __name__ == "__main__":
    main()
