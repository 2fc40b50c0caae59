"""`python -m sdt_drake` is `sdt-drake`."""

from sdt_drake.cli import main

if __name__ == "__main__":
    raise SystemExit(main())
