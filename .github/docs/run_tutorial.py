"""Run the tutorial notebook and store its outputs, with a picture in place of the 3D page.

python .github/docs/run_tutorial.py      # pip install ".[docs,exchange]" ipykernel
"""

import base64
import io
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from PIL import Image

NOTEBOOK = Path(__file__).resolve().parents[2] / "diagrams/tutorial.ipynb"
PAGE = NOTEBOOK.with_name("page.png")
"""The picture of a 3D page."""
MAX_OUTPUT = 300_000  # characters; the 3D page has ten times as many


def smaller(png: str) -> str:
    """Return a picture in base64 with 256 colours: fewer would mix those of a legend."""
    made = io.BytesIO()
    with Image.open(io.BytesIO(base64.b64decode(png))) as image:
        image.convert("RGB").quantize(256).save(made, "PNG", optimize=True)
    return base64.b64encode(made.getvalue()).decode()


def main() -> None:
    notebook = nbformat.read(NOTEBOOK, 4)
    NotebookClient(notebook, timeout=600, kernel_name="python3", record_timing=False).execute()
    for cell in notebook.cells:
        cell.pop("id", None)
        if cell.cell_type == "code":
            cell.outputs = [one for one in cell.outputs if one.get("name") != "stderr"]
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            for kind in [kind for kind, value in data.items() if len(str(value)) > MAX_OUTPUT]:
                if kind != "image/png":
                    del data[kind]
                    data["image/png"] = base64.b64encode(PAGE.read_bytes()).decode()
            if "image/png" in data:
                data["image/png"] = smaller(data["image/png"])
    kernel = notebook.metadata["kernelspec"]
    notebook.metadata = {"kernelspec": kernel, "language_info": {"name": "python"}}
    notebook.nbformat_minor = 4  # without ids of cells, which are new at each run
    nbformat.write(notebook, NOTEBOOK)


if __name__ == "__main__":
    main()
