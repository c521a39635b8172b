"""Batches of closed loops: equal to ``simulate``, independent of threads and blocks, bounded."""

import itertools
import tracemalloc
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest

from omnidrive.control import (
    FeedforwardController,
    Pipeline,
    Retiming,
    Status,
    WheelSpeeds,
    holonomic_nmpc,
)
from omnidrive.control.controller import CommandLimits
from omnidrive.control.nmpc.holonomic import (
    Actuation,
    FallbackLevel,
    HolonomicSolver,
    KeepOutZone,
)
from omnidrive.control.nmpc.holonomic.law import OLD_PLAN_STEPS, RAMP_STEPS
from omnidrive.control.pid import (
    FuzzyPidController,
    PidChannel,
    TrackingParameters,
    TrackingPidController,
    classical_pid,
    fuzzy_pid,
    gain_inference,
)
from omnidrive.control.pid.tuners import FuzzyTuner
from omnidrive.errors import InvalidInput
from omnidrive.evaluation import measure
from omnidrive.fuzzy import Inference
from omnidrive.geometry import Pose
from omnidrive.reference import Eight, Hold, SampledReference, ShapeReference
from omnidrive.robot import named_robot
from omnidrive.simulation import (
    KinematicPlant,
    MujocoPlant,
    Outcome,
    PaperNoise,
    PlanarPlant,
    Schedule,
    default_faults,
    parse_fault,
    run_generators,
    simulate,
    simulate_batch,
    simulate_commands,
)
from omnidrive.testing.laws import Circle
from tests.laws.one_file_laws import ONE_FILE_LAWS, one_file_law


@cache
def robot(name):
    return named_robot(name)


def nmpc(dt, **options):
    """The NMPC of the robot paper, whose commands are delayed by 1.5 samples."""
    actuation = Actuation.of(robot("paper"), delay=1.5 * dt)
    return holonomic_nmpc(robot("paper").chassis, dt, actuation=actuation, **options)


SEED = 11
PRESETS = ("recommended", "paper", "published-code")
LAWS = (
    {"feedforward": FeedforwardController, "nmpc": nmpc}
    | {name: partial(one_file_law, name, named_robot("paper")) for name in ONE_FILE_LAWS}
    | {
        f"{kind} {preset}": (lambda dt, k=kind, p=preset: make_pid(k, p, dt))
        for kind in ("pid", "t1", "t2", "t3")
        for preset in PRESETS
    }
)
START = Pose(0.1, -1.1, 0.3)
PLANTS = {"kinematic": KinematicPlant, "planar": PlanarPlant}
FAULTS = {
    "kinematic": ("pose-jump", "sensor-silent", "encoder-dead", "solver-overrun", "period-jitter"),
    "planar": tuple(fault.kind for fault in default_faults(0.5)),
}
REFERENCES = {
    "own": Circle(0.5, 3.0),  # an object with the methods of a reference only
    "sampled": SampledReference.of(Circle(0.5, 3.0), 0.25),
    "hold": Hold(Pose(0.5, -0.5, 2.0), 2.0),
}
ARRAYS = (
    "t", "pose", "measured", "position_sigma", "yaw_sigma", "target", "command", "twist",
    "wheel_speed", "wheel_torque", "saturated", "work", "status", "collisions",
    "wheel_speed_command", "wheel_torque_command",
)  # fmt: skip


def make_pid(kind, preset, dt):
    return classical_pid(preset, dt) if kind == "pid" else fuzzy_pid(kind, preset, dt)


def schedule_of(kind, robot_name="paper", at=0.5):
    if kind is None:
        return None
    faults = [parse_fault(f"{each}:at={at}") for each in kind.split("+")]
    return Schedule(tuple(faults), robot(robot_name))


def differences(run, other):
    """Names of the columns in which two logs differ in any bit."""
    assert list(run.details) == list(other.details)
    pairs = {name: (getattr(run, name), getattr(other, name)) for name in ARRAYS}
    pairs |= {name: (run.details[name], other.details[name]) for name in run.details}
    return {k for k, (a, b) in pairs.items() if not np.array_equal(a, b, equal_nan=True)}


def assert_equals_simulate(plant, law, reference, dt, kind, *, noisy, robot_name="paper"):
    """One cell of the grid: run 3 of a batch of other runs, and the same run alone."""
    plant, schedule = PLANTS[plant](robot(robot_name)), schedule_of(kind, robot_name)
    start, make = START, LAWS.get(law, law)
    (batch,) = simulate_batch(
        plant,
        make(dt),
        [reference] * 3,
        dt=dt,
        starts=[Pose(0.0, -1.0, 0.0), start, start],
        sensors=PaperNoise if noisy else None,
        schedule=schedule,
        seed=SEED,
        first=1,
        logs=True,
    )
    noise, jitter = run_generators(SEED, 3)
    run = simulate(
        plant,
        make(dt),
        reference,
        start=start,
        dt=dt,
        sensors=PaperNoise(noise) if noisy else None,
        schedule=schedule,
        rng=jitter,
    )
    log = batch.logs[2]
    assert not differences(run, log)
    assert (run.outcome, run.events, run.detail_units) == (
        log.outcome,
        log.events,
        log.detail_units,
    )
    metrics = measure(run, robot(robot_name).chassis)
    assert batch.me[2] == pytest.approx(metrics.me, rel=1e-12, abs=1e-15)
    assert batch.mae[2] == pytest.approx(metrics.mae, rel=1e-12, abs=1e-15)
    assert batch.max_error[2] == metrics.max_error
    assert batch.work[2] == pytest.approx(metrics.work, nan_ok=True, abs=0.0)
    assert batch.statuses[2].tolist() == [(run.status == i).sum() for i in range(3)]
    return run


@pytest.mark.parametrize("kind", [None, "pose-jump+sensor-silent", "solver-overrun+period-jitter"])
@pytest.mark.parametrize("law", ["t1 recommended", "pid recommended"])
def test_kinematic_runs_equal_simulate(law, kind):
    assert_equals_simulate("kinematic", law, REFERENCES["sampled"], 0.1, kind, noisy=True)


@pytest.mark.parametrize(
    "law",
    [pytest.param(n, marks=pytest.mark.long) if n == "mppi" else n for n in ONE_FILE_LAWS],
)
def test_runs_of_one_file_laws_equal_simulate(law):
    kind = "pose-jump+solver-overrun"
    assert_equals_simulate("kinematic", law, REFERENCES["own"], 0.1, kind, noisy=True)


@pytest.mark.parametrize("kind", [None, "push+slope+sensor-silent", "wheel-locked+payload"])
def test_planar_runs_equal_simulate(kind):
    assert_equals_simulate("planar", "feedforward", REFERENCES["own"], 0.1, kind, noisy=True)


EIGHT = ShapeReference(Eight(), 4.0)  # faster than the robot


@pytest.mark.parametrize(
    ("plant", "reference", "kind", "noisy"),
    [
        ("kinematic", REFERENCES["own"], None, True),
        ("kinematic", EIGHT, "solver-overrun+period-jitter", False),
        ("planar", EIGHT, "sensor-silent+slope", True),
        ("planar", REFERENCES["hold"], "pose-jump+solver-overrun", False),
    ],
)
def test_runs_of_the_nmpc_equal_simulate(plant, reference, kind, noisy):
    run = assert_equals_simulate(plant, "nmpc", reference, 0.1, kind, noisy=noisy)
    largest_delay = np.nanmax(run.details["reference_delay"])
    assert largest_delay > 2.0 if reference is EIGHT else largest_delay == 0.0
    assert (run.status == Status.OK).sum() > 20


def test_setpoints_beyond_the_first_evaluation_equal_simulate():
    """300 samples; the controller evaluates the reference for 256 at once."""
    reference = REFERENCES["sampled"]
    run = assert_equals_simulate("kinematic", "nmpc", reference, 0.01, None, noisy=True)
    assert len(run.t) == 301


class Vanishes(Circle):
    """Setpoints that are no numbers after a time."""

    def window(self, t, n, dt):
        rows = super().window(t, n, dt)
        return rows if t < 0.75 else np.full_like(rows, np.nan)


class Raises(Circle):
    """A window that raises an exception after a time."""

    def window(self, t, n, dt):
        if t > 0.75:
            raise RuntimeError("lost")
        return super().window(t, n, dt)


@pytest.mark.parametrize("kind", [None, "solver-overrun"])
def test_fallback_levels_of_the_nmpc_equal_simulate(kind):
    """The latest plan is followed, then ramped down, then the controller has failed."""
    run = assert_equals_simulate("kinematic", "nmpc", Vanishes(), 0.1, kind, noisy=False)
    assert run.outcome is Outcome.CONTROLLER_FAILED
    levels = run.details["fallback_level"][np.isfinite(run.details["fallback_level"])]
    expected = [FallbackLevel.OLD_PLAN] * OLD_PLAN_STEPS + [FallbackLevel.RAMP] * RAMP_STEPS
    assert levels[-OLD_PLAN_STEPS - RAMP_STEPS :].tolist() == expected
    assert (levels[: -OLD_PLAN_STEPS - RAMP_STEPS] < FallbackLevel.OLD_PLAN).all()


@pytest.mark.parametrize("law", ["nmpc", "pid recommended"])
def test_setpoints_that_raise_end_the_run_as_simulate_does(law):
    run = assert_equals_simulate("kinematic", law, Raises(), 0.1, None, noisy=False)
    assert run.outcome is Outcome.CONTROLLER_FAILED


def test_keep_out_zones_of_the_nmpc_equal_simulate():
    reference, plant = REFERENCES["sampled"], KinematicPlant(robot("paper"))
    free = simulate(plant, nmpc(0.1), reference, start=START, dt=0.1)
    zone = KeepOutZone(free.pose[15, :2], 0.25)
    law = partial(nmpc, keep_outs=[zone])
    run = assert_equals_simulate("kinematic", law, reference, 0.1, None, noisy=False)
    assert np.hypot(*(run.pose[:, :2] - zone.centres).T).min() > 0.15  # a plan without zones: 0


@pytest.mark.parametrize("options", [{"threads": 2, "block": 3}, {"threads": 3, "block": 1}])
def test_runs_of_the_nmpc_do_not_depend_on_threads(options):
    references = [REFERENCES["sampled"], EIGHT, REFERENCES["hold"]] * 3
    common = {"dt": 0.1, "sensors": PaperNoise, "seed": SEED}

    def batch(**more):
        plant = KinematicPlant(robot("paper"))
        return figures(simulate_batch(plant, nmpc(0.1), references, **common | more))

    assert (batch() == batch(**options)).all()


@pytest.mark.long
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("plant", PLANTS)
def test_whole_grid_equals_simulate(plant, law):
    """Every law and plant with every fault, reference, robot and sample time at least once."""
    references, robots = itertools.cycle(REFERENCES.values()), itertools.cycle(["paper", "mecanum"])
    times = itertools.cycle([0.1, 0.02, 0.05, 0.3])
    for kind in (None, *FAULTS[plant], "+".join(FAULTS[plant])):
        for noisy in (False, True):
            cell = (next(references), next(times), kind)
            assert_equals_simulate(plant, law, *cell, noisy=noisy, robot_name=next(robots))


def kinematic_batch(runs=37, **options):
    controller = fuzzy_pid("t1", "recommended", 0.1)
    references = [REFERENCES["sampled"], REFERENCES["hold"]] * (runs // 2) + [REFERENCES["hold"]]
    common = {"dt": 0.1, "sensors": PaperNoise, "seed": SEED}
    return simulate_batch(
        KinematicPlant(robot("paper")), controller, references[:runs], **common | options
    )


def figures(blocks):
    return np.vstack([np.column_stack([b.me, b.mae, b.max_error, b.statuses]) for b in blocks])


@pytest.mark.parametrize(
    "options",
    [{"threads": 2, "block": 5}, {"threads": 3, "block": 1}, {"block": 7}, {"threads": 2}],
)
def test_results_depend_neither_on_threads_nor_on_blocks(options):
    alone = figures(kinematic_batch())
    blocks = list(kinematic_batch(**options))
    sizes = [len(block.me) for block in blocks]
    assert [block.first for block in blocks] == [sum(sizes[:i]) for i in range(len(sizes))]
    assert (figures(blocks) == alone).all()
    assert len(np.unique(alone[:, 0])) == len(alone)  # every run has its own noise


def test_batch_can_be_split():
    whole, part = figures(kinematic_batch()), figures(kinematic_batch(runs=10, first=10))
    assert (part == whole[10:20]).all()


def test_plant_and_controller_are_not_changed():
    plant, controller = KinematicPlant(robot("paper")), classical_pid("recommended", 0.1)
    plant.reset(Pose(1.0, 2.0, 0.5))
    list(simulate_batch(plant, controller, [Circle()], dt=0.1, schedule=schedule_of("pose-jump")))
    assert plant.step(WheelSpeeds([0.0] * 4), 0.1).pose == (1.0, 2.0, 0.5)


def test_runs_are_made_when_they_are_needed():
    """Memory does not grow with the number of runs."""
    made = itertools.count()

    def endless():
        while True:
            next(made)
            yield REFERENCES["hold"]

    batch = kinematic_batch_of(endless(), block=10, threads=2)
    next(batch)
    tracemalloc.start()
    try:
        for _ in range(6):
            next(batch)
        early, _ = tracemalloc.get_traced_memory()
        for _ in range(20):
            next(batch)
        late, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
        batch.close()
    assert next(made) < 27 * 10 + 10 * (1 + 2 * 2 * 16 // 10) + 10
    assert late - early < 300_000  # of blocks in progress; the logs of 200 runs take 2 MB
    assert peak < 20_000_000


def test_long_runs_end_a_block_early(monkeypatch):
    """References of 201 samples with three setpoints of six numbers each."""
    monkeypatch.setattr("omnidrive.simulation.batch.batch._BLOCK_FLOATS", 6 * 201 * 18)
    references = (Hold(Pose(0.0, 0.0, 0.0), 20.0) for _ in range(8))
    assert [len(block.me) for block in kinematic_batch_of(references)] == [6, 2]
    assert [len(b.me) for b in kinematic_batch_of([REFERENCES["hold"]] * 50)] == [50]


def kinematic_batch_of(references, **options):
    controller = classical_pid("recommended", 0.1)
    plant = KinematicPlant(robot("paper"))
    return simulate_batch(plant, controller, references, dt=0.1, sensors=PaperNoise, **options)


class Breaks(Circle):
    """A reference that fails after a time."""

    def at(self, t):
        if t > 0.95:
            raise RuntimeError("lost")
        return super().at(t)

    def window(self, t, n, dt):
        return Circle().window(t, n, dt)


class Overflows(Circle):
    """Setpoints with infinite velocity after a time."""

    def window(self, t, n, dt):
        rows = super().window(t, n, dt)
        return rows if t < 0.95 else np.full_like(rows, np.inf)


@pytest.mark.parametrize(
    ("reference", "outcome"),
    [(Breaks(), Outcome.REFERENCE_FAILED), (Overflows(), Outcome.CONTROLLER_FAILED)],
)
@pytest.mark.parametrize("kind", [None, "solver-overrun"])
def test_failed_runs_equal_simulate(reference, outcome, kind):
    schedule = schedule_of(kind, at=0.7)
    start = Pose(0.1, -1.1, 0.3)
    (batch,) = kinematic_batch_of(
        [reference, REFERENCES["hold"]], starts=[start] * 2, schedule=schedule, seed=SEED, logs=True
    )
    run = simulate(
        KinematicPlant(robot("paper")),
        classical_pid("recommended", 0.1),
        reference,
        start=start,
        dt=0.1,
        sensors=PaperNoise(run_generators(SEED, 0)[0]),
        schedule=schedule,
    )
    assert batch.outcomes == (outcome, Outcome.FINISHED)
    assert run.outcome is outcome
    assert not differences(run, batch.logs[0])
    assert run.events == batch.logs[0].events


class Late(FeedforwardController):
    """A controller that reaches the end of a reference 0.45 s later."""

    def retime(self, reference):
        return Retiming(Hold(reference.pose, reference.duration + 0.45), "too fast")


def test_input_that_a_fuzzy_system_refuses_fails_the_run_as_in_simulate():
    """It gives no gains, instead of zero gains."""
    usual = fuzzy_pid("t1", "paper", 0.1)
    tuner = FuzzyTuner(Inference(gain_inference("t1", "paper").system, out_of_range="raise"))
    channels = (replace(each, tune=tuner) for each in (usual.position, usual.heading))
    controller = FuzzyPidController(0.1, *channels, wraps_heading=True)
    plant, far, start = (
        KinematicPlant(robot("paper")),
        Hold(Pose(9.0, 0.0, 0.0), 1.0),
        Pose(0.0, 0.0, 0.0),
    )
    (batch,) = simulate_batch(plant, controller, [far], dt=0.1, starts=[start], logs=True)
    run = simulate(plant, controller, far, start=start, dt=0.1)
    assert "'error' is 4.5, outside its range" in run.reason
    assert batch.logs[0].outcome is run.outcome is Outcome.CONTROLLER_FAILED
    assert not differences(run, batch.logs[0])


def test_retimed_runs_equal_simulate():
    plant, start = PlanarPlant(robot("paper")), Pose(0.1, -1.1, 0.3)
    options = {"dt": 0.1, "schedule": schedule_of("push")}
    references, starts = [REFERENCES["hold"]], [start]
    (batch,) = simulate_batch(plant, Late(0.1), references, starts=starts, logs=True, **options)
    run = simulate(plant, Late(0.1), REFERENCES["hold"], start=start, **options)
    assert not differences(run, batch.logs[0])
    assert run.events == batch.logs[0].events
    assert [event.what for event in run.events] == ["too fast", "push begins"]


RANDOM_LAWS = ("feedforward", "nmpc", *(f"{k} {p}" for k in ("pid", "t1", "t3") for p in PRESETS))


class Noticing(FeedforwardController):
    """A controller with two notices at the start."""

    def command_limits(self, reference):
        return CommandLimits(1.0, 1.0)

    def retime(self, reference):
        return Retiming(reference, "later")


def random_run(rng, plants, laws):
    """Plant, law, reference, sample time and faults; also faults and notices at one time."""
    plant = str(rng.choice(plants))
    duration = float(rng.choice([1.0, 2.0, 4.0]))
    circle = Circle(float(rng.choice([0.2, 2.0])), duration)  # the faster ones exceed limits
    reference = rng.choice([circle, SampledReference.of(circle, 0.25), Vanishes(0.5, duration)])
    faults = [
        parse_fault(f"{kind}:at={rng.choice([0.0, 0.25, 0.5, duration - 0.1])}")
        for kind in rng.permutation(FAULTS[plant])[: rng.integers(4)]
    ]
    spans = [
        fault.model_copy(update={"duration": float(rng.choice([0.1, 0.4]))})
        if "duration" in type(fault).model_fields and rng.random() < 0.5
        else fault
        for fault in faults
    ]
    dt = float(rng.choice([0.1, 0.05, 0.3]))
    return (
        plant,
        laws[int(rng.integers(len(laws)))],
        reference,
        dt,
        Schedule(tuple(spans), robot("paper")),
    )


def events_of_random_runs(count, seed, plants, laws):
    """Compare log and events of random runs with ``simulate``; return the texts of the events."""
    rng, texts = np.random.default_rng(seed), []
    for _ in range(count):
        plant, law, reference, dt, schedule = random_run(rng, plants, laws)
        options = {"dt": dt, "schedule": schedule}
        plant, start = PLANTS[plant](robot("paper")), START
        (batch,) = simulate_batch(
            plant, law(dt), [reference], starts=[start], seed=SEED, logs=True, **options
        )
        jitter = run_generators(SEED, 0)[1]
        run = simulate(plant, law(dt), reference, start=start, rng=jitter, **options)
        assert not differences(run, batch.logs[0])
        assert (run.outcome, run.events) == (batch.logs[0].outcome, batch.logs[0].events)
        texts += [event.what for event in run.events]
    return texts


def test_events_of_random_runs_equal_simulate():
    laws = [FeedforwardController, Noticing]
    texts = events_of_random_runs(48, 1, ["kinematic"], laws)
    assert any("the robot falls behind" in text for text in texts)
    assert "later" in texts
    assert any(text.endswith("begins") for text in texts)
    assert any(text.endswith("ends") for text in texts)


@pytest.mark.long
def test_events_of_many_random_runs_equal_simulate():
    laws = [*(LAWS[name] for name in RANDOM_LAWS), Noticing]
    assert len(events_of_random_runs(210, 2, list(PLANTS), laws)) > 210


class Slower(FeedforwardController):
    def compute(self, t, state, reference):
        return super().compute(t - 0.1, state, reference)


class Drifting(KinematicPlant):
    pass


def recommended_pid(dt):
    return classical_pid("recommended", dt)


def refused(match, plant=KinematicPlant, controller=recommended_pid, **options):
    references = options.pop("references", [Circle()])
    with pytest.raises(InvalidInput, match=match):
        list(
            simulate_batch(
                plant(robot("paper")), controller(0.1), references, **{"dt": 0.1} | options
            )
        )


def own_tuner(dt):
    channels = [PidChannel(lambda e, c: (0.0,) * 3, dt, TrackingParameters()) for _ in "xyh"]
    return TrackingPidController(dt, *channels)


def nmpc_with_deadline(dt):
    controller = nmpc(dt)
    controller.solver = HolonomicSolver(deadline=1.0)
    return controller


def test_unsupported_parts_are_refused():
    refused("plants kinematic and planar, got", lambda r: MujocoPlant(r, "ball"))
    refused("plants kinematic and planar, got", Drifting)
    refused("all of omnidrive but unicycle-nmpc have one.*Slower", controller=Slower)
    refused("with a deadline", controller=nmpc_with_deadline)
    refused("moving keep-out zones", controller=lambda dt: nmpc(dt, keep_outs=lambda t, n, dt: ()))
    refused("with channels or tuners of your own", controller=own_tuner)
    refused("not a pipeline: its state estimate", controller=lambda dt: Pipeline(Slower(dt)))
    refused("no push: it accepts pose-jump", schedule=schedule_of("push"))


def test_bad_numbers_are_refused():
    refused("built for a sample time of 0.1 s", dt=0.2)
    refused("dt|sample time", dt=0.0)
    refused("threads", threads=0)
    refused("block", block=0)
    refused("seed must be a whole number from 0, got -1", seed=-1)
    refused("end after 1", references=[Circle()] * 2, starts=[Pose(0.0, 0.0, 0.0)])
    refused("run 0: .* in rad, not degrees", starts=[Pose(0.0, 0.0, 90.0)])
    refused("must be finite", starts=[Pose(np.nan, 0.0, 0.0)])
    refused("begins at 50 s, but the run ends", schedule=schedule_of("pose-jump", at=50.0))
    refused("at most 1,000,000 samples", references=[Hold(Pose(0.0, 0.0, 0.0), 1e6)])


def test_commands_of_a_closed_loop_give_its_motion():
    """The open-loop batch of the planar plant executes the log of a closed loop."""
    run = simulate(
        PlanarPlant(robot("paper")),
        FeedforwardController(0.1),
        Circle(),
        start=Pose(0.1, -1.1, 0.3),
        dt=0.1,
    )
    poses, _ = simulate_commands(robot("paper"), run.pose[:1], run.command[None, :-1], 0.1)
    assert (poses[0] == run.pose[1:]).all()
