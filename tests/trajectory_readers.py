#!/usr/bin/env python3
"""Reads moltop's trajectories with ASE and MDAnalysis, and compares every frame with the state at its time.

    tests/trajectory_readers.py [MOLTOP] [--ovito]

MOLTOP is the program, target/release/moltop if none is given. The readers come from PyPI into a virtual environment in the
user's cache; without Python's venv or a network the script says so and ends with 0. Not part of `cargo test` or CI.
"""

import csv
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

FRAMES, BALLS, EVERY = 1001, 1000, 0.2
CENTER, EDGE = (1.0, 2.0, -3.0), 12.6
SETTLED = 96  # the frames that the averages of a run of 1,001 looks leave out: three blocks of 32

SCENE = f"""units = "reduced"
[domain]
kind = "periodic"
size = [{EDGE}, {EDGE}, {EDGE}]
center = {list(CENTER)}
[[species]]
count = {BALLS}
radius = 0.5
mass = 1
velocity = {{ kind = "normal", deviation = 1 }}
[observe]
every = {EVERY / 10}
radial_distribution = true
[run]
sample = {EVERY}
"""


def environment(packages):
    """Python of a virtual environment with the packages; ends the script where that cannot be made."""
    cache = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "moltop-trajectory-readers"
    python = cache / "bin" / "python"
    try:
        if not python.exists():
            subprocess.run([sys.executable, "-m", "venv", cache], check=True, capture_output=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", *packages], check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError) as why:
        print(f"skipped: no Python environment with {', '.join(packages)}: {why}")
        sys.exit(0)
    return python


def make(moltop, directory):
    """A run with both trajectories, and the state at every frame's time from a run that is stopped there."""
    def run(*arguments):
        subprocess.run([moltop, "run", *arguments], cwd=directory, check=True, capture_output=True)

    (directory / "scene.toml").write_text(SCENE)
    until = str((FRAMES - 1) * EVERY)
    run("scene.toml", "--until", until, "--trajectory", "t.xyz", "--summary", "summary.json", "--run-dir", "whole")
    run("scene.toml", "--until", until, "--trajectory", "t.lammpstrj", "--run-dir", "other")
    for frame in range(1, FRAMES):
        start = ["stopped"] if frame > 1 else ["scene.toml", "--run-dir", "stopped"]
        run(*start, "--until", repr(frame * EVERY), "--state", f"{frame}.csv")


def compare(directory):
    import numpy as np

    def state(frame):
        with open(directory / f"{frame}.csv") as file:
            rows = list(csv.reader(file))[1:]
        return np.array([[float(cell) for cell in row[1:9]] for row in rows])

    states = [None] + [state(frame) for frame in range(1, FRAMES)]
    low = np.array(CENTER) - EDGE / 2
    compare_ase(directory, states, low, np)
    compare_mdanalysis(directory, states, low, np)


def compare_ase(directory, states, low, np):
    import ase.io
    from ase.calculators.lammps import convert

    print(f"ASE {ase.__version__}")
    frames = ase.io.read(directory / "t.xyz", index=":")
    assert len(frames) == FRAMES
    for number, (frame, state) in enumerate(zip(frames, states)):
        assert frame.info["Time"] == number * EVERY
        assert (frame.cell.lengths() == EDGE).all() and frame.pbc.all()
        assert (frame.info["Origin"] == low).all()
        if state is not None:
            assert (frame.positions == state[:, 0:3]).all(), number
            assert (frame.arrays["velo"] == state[:, 3:6]).all(), number
            assert (frame.arrays["radius"] == state[:, 6]).all()
            assert (frame.arrays["mass"] == state[:, 7]).all()
    print(f"  extended XYZ: {FRAMES} frames of {BALLS}: positions, velocities, box and times equal, every bit")
    frames = ase.io.read(directory / "t.lammpstrj", index=":", format="lammps-dump-text")
    assert len(frames) == FRAMES
    unit = convert(1.0, "velocity", "metal", "ASE")  # ASE takes a dump for one in LAMMPS's metal units
    worst = 0.0
    for number, (frame, state) in enumerate(zip(frames, states)):
        assert abs(frame.cell.lengths() - EDGE).max() < 1e-14 * EDGE and frame.pbc.all()
        if state is not None:
            assert (frame.positions == state[:, 0:3]).all(), number
            worst = max(worst, abs(frame.get_velocities() / unit / state[:, 3:6] - 1).max())
    assert worst < 4e-16 * 4, worst
    print(f"  LAMMPS dump: {FRAMES} frames: positions equal, every bit; velocities, through ASE's units, to {worst:.1e}")


def compare_mdanalysis(directory, states, low, np):
    import MDAnalysis
    from MDAnalysis.analysis.rdf import InterRDF

    print(f"MDAnalysis {MDAnalysis.__version__} (which keeps 24 bits)")
    dump = MDAnalysis.Universe(str(directory / "t.lammpstrj"), format="LAMMPSDUMP", dt=EVERY)
    xyz = MDAnalysis.Universe(str(directory / "t.xyz"))
    assert len(dump.trajectory) == len(xyz.trajectory) == FRAMES
    moved = 0.0
    for number, state in enumerate(states):
        frame, bare = dump.trajectory[number], xyz.trajectory[number]
        assert abs(frame.time - number * EVERY) <= 1e-15 * number, number
        assert abs(frame.dimensions[:3] - EDGE).max() < 1e-6 * EDGE
        if state is None:
            continue
        moved = max(moved, abs(frame.positions + low - state[:, 0:3]).max())
        assert (frame.velocities == state[:, 3:6].astype(np.float32)).all(), number
        assert (bare.positions == state[:, 0:3].astype(np.float32)).all(), number
    assert moved < 2e-6
    print(f"  LAMMPS dump: {FRAMES} frames: velocities and times equal, positions to {moved:.1e} of {EDGE}")
    print(f"  XYZ: {FRAMES} frames: positions equal")

    ours = json.loads((directory / "summary.json").read_text())["observables"]["radial_distribution"]
    r, g = np.array(ours["distance"], dtype=float), np.array(ours["radial_distribution"], dtype=float)
    width = r[1] - r[0]
    edges = (r[0] - width / 2, r[-1] + width / 2)
    theirs = InterRDF(dump.atoms, dump.atoms, nbins=len(r), range=edges, exclusion_block=(1, 1)).run(start=SETTLED)
    counts = theirs.results.count / 2
    error = g / np.sqrt(counts)
    off = abs(theirs.results.rdf - g) / error
    print(
        f"  g(r): {len(r)} bins from {edges[0]:.2f} to {edges[1]:.2f}, {counts.sum():.0f} pairs: "
        f"the farthest bin is {off.max():.2f} counting errors from ours ({abs(theirs.results.rdf / g - 1).max():.1e}), all bins together {np.sqrt((off**2).mean()):.2f}"
    )
    assert off.max() < 1, off


def show_ovito(directory):
    import numpy as np
    import ovito
    from ovito.io import import_file

    print(f"OVITO {ovito.version_string}")
    for name in ["t.xyz", "t.lammpstrj"]:
        pipeline = import_file(str(directory / name), multiple_frames=True)
        assert pipeline.source.num_frames == FRAMES
        frame = 500
        data = pipeline.compute(frame)
        with open(directory / f"{frame}.csv") as file:
            state = np.array([[float(cell) for cell in row[1:9]] for row in list(csv.reader(file))[1:]])
        # Its reader of numbers is off by a bit or two of 53.
        moved = abs(np.array(data.particles.positions) - state[:, 0:3]).max()
        turned = abs(np.array(data.particles["Velocity"]) / state[:, 3:6] - 1).max()
        assert moved < 1e-14 * EDGE and turned < 1e-14, (moved, turned)
        assert abs(np.array(data.particles["Radius"]) - state[:, 6]).max() < 1e-7
        cell = np.array(data.cell[...])
        assert abs(np.diag(cell[:, :3]) - EDGE).max() < 1e-6 and all(data.cell.pbc)
        said = {key: data.attributes[key] for key in ("Time", "Timestep") if key in data.attributes}
        print(f"  {name}: {FRAMES} frames; number {frame}: positions to {moved:.1e}, velocities to {turned:.1e}, radii and box equal; {said}")


def main():
    if len(sys.argv) > 2 and sys.argv[1] == "compare":
        return compare(Path(sys.argv[2]))
    if len(sys.argv) > 2 and sys.argv[1] == "ovito":
        return show_ovito(Path(sys.argv[2]))
    with_ovito = "--ovito" in sys.argv
    programs = [argument for argument in sys.argv[1:] if argument != "--ovito"]
    root = Path(__file__).resolve().parent.parent
    moltop = Path(programs[0] if programs else root / "target/release/moltop").resolve()
    if not moltop.exists():
        sys.exit(f"{moltop}: build it first: cargo build --release")
    python = environment(["ase", "MDAnalysis"] + (["ovito"] if with_ovito else []))
    with tempfile.TemporaryDirectory() as directory:
        directory = Path(directory)
        os.environ["XDG_STATE_HOME"] = str(directory / "state")
        make(moltop, directory)
        for what in ["compare"] + (["ovito"] if with_ovito else []):
            subprocess.run([python, __file__, what, directory], check=True)


main()
