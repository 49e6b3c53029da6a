"""python -m sil: the same as the command `sil`."""

from sil.cli import main

if __name__ == "__main__":
    main()
