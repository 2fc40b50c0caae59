"""`python -m sdt_drake` is `sdt-drake`."""

import sys

if __name__ == "__main__":
    # `-m` puts the working directory first, where a file may be called like any module.
    if not getattr(sys.flags, "safe_path", sys.flags.isolated):
        del sys.path[0]
    from sdt_drake.cli import main

    raise SystemExit(main())
