"""Every figure and diagram here, drawn again.

    python diagrams/redraw.py [FOLDER]

Runs the other scripts, which write into FOLDER, by default the folder of this script; the figures
of the studies are drawn from their stored rows. Takes some two minutes.
"""

import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
BEFORE = {"studies": [HERE / "studies" / name for name in ("monte_carlo", "sizing")]}
"""What a script takes before the folder."""


def main(folder: Path) -> None:
    for script in sorted(HERE.glob("*.py")):
        if script.stem != "redraw":
            print(script.name, flush=True)
            command = [sys.executable, script, *BEFORE.get(script.stem, []), folder]
            subprocess.run(command, check=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)
