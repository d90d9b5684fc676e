"""The first part of docs/cluster.md, word for word, with smaller numbers."""

import os
import subprocess
from pathlib import Path

PAGE = Path(__file__).parents[3] / "docs" / "cluster.md"


def test_from_nothing_to_a_film(program, tmp_path):
    text = PAGE.read_text()
    lines = text.split("```sh\n")[1].split("```")[0]
    assert lines.count("brickwalk") == 2
    for large, small in [("300K", "10K"), ("--frames 60", "--frames 4"), ("640x360", "64x36")]:
        assert large in lines
        lines = lines.replace(large, small)
    folders = [os.path.dirname(program), os.path.dirname(os.sys.executable), os.environ["PATH"]]
    environment = {**os.environ, "PATH": os.pathsep.join(folders)}
    done = subprocess.run(["sh", "-ec", lines], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "0003.png" in done.stdout and "film/report.html" in done.stdout
    assert "4 frames, 4 rendered now" in done.stdout
