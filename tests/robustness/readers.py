"""All readers of files, each with valid files that are mutated."""

from __future__ import annotations

import io
import warnings
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
import yaml
from PIL import Image

from omnidrive.fuzzy import (
    Footprint,
    FuzzySet,
    FuzzySystem,
    GapWarning,
    Inference,
    InputVariable,
    LinearFunction,
    Membership,
    OutputVariable,
    SigmaWarning,
    load,
    parse_rule,
    save,
)
from omnidrive.fuzzy.csv_rows import evaluate_csv
from omnidrive.fuzzy.files.fcl import write_fcl
from omnidrive.geometry import BodyTwist
from omnidrive.maps import (
    CostMap,
    OccupancyGrid,
    load_costs,
    load_map,
    load_queries,
    save_nav2_map,
)
from omnidrive.planning import Path as PosePath
from omnidrive.reference.sampled_reference import SampledReference
from omnidrive.reference.waypoint_motion import load_motion_problem
from omnidrive.reference.waypoint_reference import waypoint_reference
from omnidrive.reference.waypoints import save_waypoints
from omnidrive.robot import load_robot, named_robot, save_robot
from omnidrive.robot.imports import import_robot
from omnidrive.scenario import load_scenario, paper_scenario, save_scenario
from omnidrive.scenario.controller_file import load_controller
from omnidrive.simulation import load_run
from omnidrive.simulation.identification import identify_robot, read_log
from omnidrive.study import StudyDefinition, load_definition, save_definition
from omnidrive.study.storage.store import Store
from omnidrive.study.stored_study import read_study
from omnidrive.tuning import load_tuning
from tests.robot.descriptions import (
    MECANUM_CONTROLLER,
    MJCF,
    OMNI_CONTROLLER,
    mecanum_urdf,
    omni_urdf,
)
from tests.robustness.deployment_readers import deployment_readers
from tests.robustness.reader import Reader
from tests.simulation.recorded_run import recorded_run
from tests.study.small import noise_scenario, small_scenario
from tests.study.synthetic import SyntheticPlan, record

MOVINGAI = b"type octile\nheight 3\nwidth 4\nmap\n.@G.\nSTO.\n....\n"
SCEN = b"version 1\n0\tm.map\t4\t3\t0\t0\t3\t2\t4.24264069\n1\tm.map\t4\t3\t3\t2\t0\t1\t3.41\n"
CSV = b"food,service\n1,2\n3.5,4e-1\n10,0\n"


@cache
def readers() -> dict[str, Reader]:
    """Return the readers by name."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        parts = (
            _maps, _fuzzy, _waypoints, _logs, _robots, _scenarios, _studies, deployment_readers,
        )  # fmt: skip
        return {name: reader for part in parts for name, reader in part(folder).items()}


def _written(path, write):
    """Return the content that ``write`` writes to a path."""
    write(path)
    return path.read_bytes()


def _maps(folder):
    cells = np.random.default_rng(1).random((9, 12)) < 0.3
    save_nav2_map(OccupancyGrid(cells, 0.05, (-1.0, 2.0), yaw=0.1), folder / "m.yaml")
    yaml, pgm = ((folder / name).read_bytes() for name in ("m.yaml", "m.pgm"))
    arrays = tuple(
        _written(folder / "m.npy", lambda path, kind=kind: np.save(path, cells.astype(kind)))
        for kind in (bool, np.int8, np.float64)
    )
    rows = b"".join(b"".join(b"#" if cell else b"." for cell in row) + b"\n" for row in cells)
    image = {"m.yaml": yaml.replace(b"m.pgm", b"image")}
    small = OccupancyGrid(np.zeros((3, 4), bool), 1.0)
    mask = CostMap.of(OccupancyGrid(np.zeros((9, 12), bool), 0.05, (-1.0, 2.0), yaw=0.1))
    scale = yaml.replace(b"trinary", b"scale") + b"type: 2\nbase: 0.1\nmultiplier: 0.02\n"
    return {
        "keep-out mask": Reader("m.yaml", (yaml, scale), mask.with_keepout, {"m.pgm": pgm}),
        "speed mask": Reader(
            "m.yaml", (scale,), lambda path: mask.with_speed_mask(path, 2.0), {"m.pgm": pgm}
        ),
        "costs": Reader("c.npy", arrays, lambda path: load_costs(path, mask.grid)),
        "nav2": Reader("m.yaml", (yaml,), _read_map, {"m.pgm": pgm}),
        "image": Reader(
            "image", _images(cells), lambda path: _read_map(path.with_name("m.yaml")), image
        ),
        "npy": Reader("m.npy", arrays, _read_map),
        "movingai": Reader("m.map", (MOVINGAI,), _read_map),
        "text": Reader("m.txt", (rows, b"? 01@\n.....\n"), _read_map),
        "any map": Reader("m", (*arrays, MOVINGAI, rows, yaml), _read_map, {"m.pgm": pgm}),
        "queries": Reader("m.scen", (SCEN,), lambda path: load_queries(path, small)),
    }


def _images(cells):
    grey = Image.fromarray(np.where(cells, 0, 254).astype(np.uint8))
    found = [b"P2 3 2 9 1 2 3 4 5 6\n", b"P4 9 2 \x80\xff\0\0"]
    modes = {"PPM": ("L", "RGB"), "BMP": ("L", "P"), "PNG": ("L", "RGBA", "P", "LA", "I;16", "1")}
    for kind, names in modes.items():
        for mode in names:
            stream = io.BytesIO()
            grey.convert(mode).save(stream, kind)
            found.append(stream.getvalue())
    return tuple(found)


def _read_map(path):
    grid = load_map(path)
    assert np.isfinite([*grid.extent, grid.resolution, grid.yaw]).all()
    assert grid.occupied.size <= 50_000_000


def _fuzzy(folder):
    mamdani, sugeno = _systems()
    type2 = mamdani.with_footprint(Footprint(0.9, 0.1))
    contents = {".fis": [mamdani, type2], ".fll": [mamdani, sugeno], ".fml": [mamdani, sugeno]}
    found = {}
    for suffix, systems in contents.items():
        valid = tuple(
            _written(folder / f"s{suffix}", lambda path, system=system: save(system, path))
            for system in systems
        )
        found[suffix] = Reader(f"s{suffix}", valid, _evaluate)
    fcl = [write_fcl(system, "fuzzylite") for system in (mamdani, sugeno)]
    fcl.append(write_fcl(_constant(sugeno), "iec"))
    found[".fcl"] = Reader("s.fcl", tuple(text.encode() for text in fcl), _evaluate)
    fis = _written(folder / "s.fis", lambda path: save(_constant(sugeno), path))
    found[".fis"] = found[".fis"]._replace(valid=(*found[".fis"].valid, fis))
    run = Inference(mamdani)
    found["inputs"] = Reader(
        "in.csv", (CSV,), lambda path: evaluate_csv(run, path, path.with_name("out.csv"))
    )
    return found


def _systems():
    """Return a Mamdani and a Sugeno system with two inputs."""

    def sets(high):
        """Return sets of five shapes."""
        half = 0.5 * high
        shapes = {
            "linzmf": (0.0, half), "trimf": (0.0, half, high), "gaussmf": (0.3 * half, high),
            "smf": (0.0, half), "zmf": (half, high),
        }  # fmt: skip
        return tuple(FuzzySet(f"s{k}", Membership(*each)) for k, each in enumerate(shapes.items()))

    inputs = (InputVariable("food", 0, 10, sets(10.0)), InputVariable("service", 0, 5, sets(5.0)))
    triangles = tuple(
        FuzzySet(f"t{k}", Membership("trimf", (at - 15.0, at, at + 15.0)))
        for k, at in enumerate((0.0, 15.0, 30.0))
    )
    functions = tuple(LinearFunction(f"t{k}", 1.5 * k, (2.0 - k, -3.0 * k)) for k in range(3))
    texts = (
        "if food is s0 or service is s1 then tip is t0 with 0.5",
        "if food is s1 and service is s3 then tip is t1",
        "if food is s4 then tip is t2",
    )
    rules = tuple(map(parse_rule, texts))
    outputs = (OutputVariable("tip", 0, 30, triangles), OutputVariable("tip", 0, 30, functions))
    return tuple(FuzzySystem("tipper", inputs, (output,), rules) for output in outputs)


def _constant(sugeno):
    """Return the system with triangles as sets of the inputs and constants as functions."""
    output = sugeno.outputs[0]
    inputs = tuple(
        replace(v, sets=tuple(FuzzySet(s.name, Membership("trimf", (0, 2, 11))) for s in v.sets))
        for v in sugeno.inputs
    )
    functions = tuple(LinearFunction(each.name, each.constant) for each in output.sets)
    rules = sugeno.rules[1:]
    return replace(sugeno, inputs=inputs, outputs=(replace(output, sets=functions),), rules=rules)


def _evaluate(path):
    """Load a system; its outputs are finite at inputs in and beyond the ranges."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", GapWarning)
        warnings.simplefilter("ignore", SigmaWarning)
        system = load(path)
    if len(system.rules) > 2000 or len(system.variables) > 20:
        return
    inside = [(v.low, 0.3 * v.low + 0.7 * v.high, v.high) for v in system.inputs]
    rows = [*zip(*inside, strict=True), *([far] * len(inside) for far in (1.7e308, -1.7e308))]
    for policy in ("clamp", "matlab"):
        outputs = Inference(system, out_of_range=policy).batch(np.array(rows))
        assert np.isfinite(outputs).all(), f"{policy}: {outputs.tolist()}"


def _waypoints(folder):
    s = np.linspace(0.0, 1.0, 9)
    poses = np.column_stack([2.0 * s, np.sin(3.0 * s), 1.5 * s])
    path, reference = PosePath(poses), SampledReference.through(4.0 * s, poses)
    robot = named_robot("small")

    def read(file):
        """Read a motion as a scenario does."""
        motion = waypoint_reference(file, robot)
        assert np.isfinite(motion.window(0.0, 7, motion.duration / 6.0)).all()

    kinds = {".csv": (path, reference), ".path": (path,), ".traj": (reference,),
             ".yaml": (path, reference)}  # fmt: skip
    problems = {
        f"problem {suffix}": Reader(
            f"p{suffix}",
            (_written(folder / f"p{suffix}", lambda p, motion=motion: save_waypoints(p, motion)),),
            load_motion_problem,
        )
        for suffix, motion in ((".traj", reference), (".path", path))
    }
    return problems | {
        f"waypoints {suffix}": Reader(
            f"w{suffix}",
            tuple(
                _written(folder / f"w{suffix}", lambda p, motion=motion: save_waypoints(p, motion))
                for motion in motions
            ),
            read,
        )
        for suffix, motions in kinds.items()
    }


def _logs(folder):
    t = 0.02 * np.arange(40)
    names = ("command_vx", "command_vy", "command_yaw_rate", "x", "y", "yaw")
    columns = {name: np.sin(t + k) for k, name in enumerate(names)}
    wheels = {f"wheel_speed_{k}": np.cos(t + k) for k in range(4)}
    table = pa.table({"t": t, **columns, **wheels})
    robot = named_robot("small")
    writers = {".csv": pa.csv.write_csv, ".parquet": pa.parquet.write_table}
    run = _written(folder / "run.parquet", recorded_run().save)
    return {
        f"log {suffix}": Reader(
            f"log{suffix}",
            (_written(folder / f"log{suffix}", lambda path, write=write: write(table, path)),),
            lambda path: identify_robot(read_log(path), robot),
        )
        for suffix, write in writers.items()
    } | {"run": Reader("run.parquet", (run,), lambda path: load_run(path).columns)}


def _robots(folder):
    files = tuple(
        _written(folder / "r.yaml", lambda path, name=name: save_robot(named_robot(name), path))
        for name in ("small", "mecanum", "kiwi")
    )
    urdf = (mecanum_urdf().encode(), omni_urdf().encode())
    parameters = (MECANUM_CONTROLLER.encode(), OMNI_CONTROLLER.encode())
    return {
        "robot": Reader("r.yaml", files, lambda path: _check(load_robot(path))),
        "urdf": Reader("r.urdf", urdf, _import),
        "mjcf": Reader("r.xml", (MJCF.encode(),), _import),
        "ros2_control": Reader("r.yaml", parameters, _import),
    }


def _import(path):
    _check(import_robot(path).robot)


def _check(robot):
    assert np.isfinite(robot.chassis.wheel_speeds(BodyTwist(1.0, -1.0, 1.0))).all()


def _scenarios(folder):
    present = _written(folder / "s.yaml", lambda path: save_scenario(paper_scenario(), path))
    return {"scenario": Reader("s.yaml", (present,), _scenario)}


def _scenario(path):
    """Read a scenario without permission to load code, and write it."""
    scenario = load_scenario(path, allow_code=False)
    save_scenario(scenario, path.with_name("again.yaml"))


STUDY = b"""format: omnidrive-study-1
name: lengths
question: Does it last longer?
scenario: paper
set: {plant: kinematic, controllers: [fuzzy_t1, pid]}
axes:
  tasks.track.durations: [[20.0], [40.0]]
random:
  method: sobol
  factors: {robot.friction: {low: 0.4, high: 0.9}}
repetitions: 4
"""
CONTROLLER = b"format: omnidrive-controller-1\ntype: pid\n"


def _store(path):
    read_study(path.parent)
    with Store(path.parent, read_only=True) as store:
        store.status()


def _studies(folder):
    sets = {"study.yaml": 1, "training.yaml": 1, "held-out.yaml": 2}
    files = {}
    for name, seed in sets.items():
        tasks = small_scenario if name == "study.yaml" else partial(noise_scenario, 1)
        definition = StudyDefinition.from_scenario(tasks(seed=seed))
        save_definition(definition, folder / name)
        files[name] = (folder / name).read_bytes()
    tuning = {"format": "omnidrive-tuning-1", "controller": "fuzzy_t1", "objectives": ["me"],
              "limits": ["max_error<=300mm"], "ranges": {}, "trials": 9}  # fmt: skip
    with Store(folder) as store:
        store.begin("{}")
        store.note("until", "width 0.1")
        plan = SyntheticPlan(4)
        store.add([record(plan[number]) for number in range(4)])
    database = store.path.read_bytes()
    del sets["study.yaml"]
    return {
        "study": Reader("s.yaml", (files["study.yaml"], STUDY), load_definition),
        "controller": Reader("c.yaml", (CONTROLLER,), load_controller),
        "tuning": Reader(
            "tuning.yaml",
            (yaml.safe_dump(tuning).encode(),),
            lambda path: load_tuning(path.parent),
            {name: files[name] for name in sets},
        ),
        "store": Reader(
            store.path.name,
            (database,),
            _store,
            {"study.yaml": files["study.yaml"]},
        ),
    }
