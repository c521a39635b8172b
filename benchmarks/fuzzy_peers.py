"""The paper's fuzzy system in other libraries, timed on request.

Runs in an environment of its own, because one library is incompatible with current NumPy. A
request is ``{"peer": name, "system": as described in fuzzy.py, "rows": [[error, derror], ...]}``;
the answer has the seconds per row and the outputs.
"""

import warnings
from time import perf_counter

import numpy as np
from peer_service import serve

warnings.filterwarnings("ignore")


def scikit_fuzzy(system):
    from skfuzzy import control, trimf

    def variable(make, v, points):
        made = make(np.linspace(v["low"], v["high"], points), v["name"])
        for name, abc in v["sets"].items():
            made[name] = trimf(made.universe, abc)
        return made

    inputs = [variable(control.Antecedent, v, 101) for v in system["inputs"]]
    outputs = [variable(control.Consequent, v, 101) for v in system["outputs"]]
    rules = [
        control.Rule(
            inputs[0][a] & inputs[1][b], [o[c] for o, c in zip(outputs, consequents, strict=True)]
        )
        for (a, b), consequents in system["rules"]
    ]
    simulation = control.ControlSystemSimulation(control.ControlSystem(rules), cache=False)

    def evaluate(error, derror):
        simulation.input[inputs[0].label] = error
        simulation.input[inputs[1].label] = derror
        simulation.compute()
        return [simulation.output[o.label] for o in outputs]

    return row_by_row(evaluate)


def simpful(system):
    from simpful import FuzzySystem, LinguisticVariable, TriangleFuzzySet

    engine = FuzzySystem(show_banner=False, verbose=False)
    for v in system["inputs"] + system["outputs"]:
        sets = [TriangleFuzzySet(*abc, term=name) for name, abc in v["sets"].items()]
        engine.add_linguistic_variable(
            v["name"], LinguisticVariable(sets, universe_of_discourse=[v["low"], v["high"]])
        )
    first, second = (v["name"] for v in system["inputs"])
    names = [v["name"] for v in system["outputs"]]
    engine.add_rules(
        [
            f"IF ({first} IS {a}) AND ({second} IS {b}) THEN ({name} IS {c})"
            for (a, b), consequents in system["rules"]
            for name, c in zip(names, consequents, strict=True)
        ]
    )

    def evaluate(error, derror):
        engine.set_variable(first, error)
        engine.set_variable(second, derror)
        found = engine.Mamdani_inference(names, subdivisions=101)
        return [found[name] for name in names]

    return row_by_row(evaluate)


def fuzzylite_engine(system):
    import fuzzylite as fl

    def variable(make, v, **more):
        terms = [fl.Triangle(name, *abc) for name, abc in v["sets"].items()]
        return make(v["name"], minimum=v["low"], maximum=v["high"], terms=terms, **more)

    engine = fl.Engine("paper")
    engine.input_variables = [variable(fl.InputVariable, v) for v in system["inputs"]]
    engine.output_variables = [
        variable(
            fl.OutputVariable, v, default_value=0.0, aggregation=fl.Maximum(),
            defuzzifier=fl.Centroid(101),
        )
        for v in system["outputs"]
    ]  # fmt: skip
    first, second = (v["name"] for v in system["inputs"])
    rules = [
        fl.Rule.create(
            f"if {first} is {a} and {second} is {b} then "
            + " and ".join(
                f"{v['name']} is {c}" for v, c in zip(system["outputs"], consequents, strict=True)
            ),
            engine,
        )
        for (a, b), consequents in system["rules"]
    ]
    engine.rule_blocks = [
        fl.RuleBlock(
            "", conjunction=fl.Minimum(), disjunction=fl.Maximum(), implication=fl.Minimum(),
            activation=fl.General(), rules=rules,
        )
    ]  # fmt: skip
    return engine


def pyfuzzylite(system):
    engine = fuzzylite_engine(system)

    def evaluate(error, derror):
        engine.input_variables[0].value = error
        engine.input_variables[1].value = derror
        engine.process()
        return [float(np.squeeze(o.value)) for o in engine.output_variables]

    return row_by_row(evaluate)


def pyfuzzylite_batch(system):
    """Evaluate by its own vectorised form, in blocks of 10,000 rows: larger ones are slower."""
    engine = fuzzylite_engine(system)

    def many(rows):
        parts = []
        for begin in range(0, len(rows), 10_000):
            engine.input_variables[0].value = rows[begin : begin + 10_000, 0]
            engine.input_variables[1].value = rows[begin : begin + 10_000, 1]
            engine.process()
            parts.append(np.column_stack([o.value for o in engine.output_variables]))
        return np.concatenate(parts)

    return many


def pyit2fls_t1(system):
    from pyit2fls import T1FS, T1Mamdani, tri_mf

    engine = T1Mamdani(engine="Minimum", defuzzification="CoG")

    def sets(v):
        universe = np.linspace(v["low"], v["high"], 101)
        return {n: T1FS(universe, tri_mf, [*abc, 1.0]) for n, abc in v["sets"].items()}

    return build(system, engine, sets, lambda found: found[1])


def pyit2fls_t2(system, method):
    from pyit2fls import IT2FS, IT2Mamdani, max_s_norm, min_t_norm, tri_mf

    engine = IT2Mamdani(min_t_norm, max_s_norm, method=method, algorithm="KM")

    def sets(v):
        universe = np.linspace(v["low"], v["high"], 101)
        return {
            n: IT2FS(universe, tri_mf, [*abc, 1.0], tri_mf, [*v["lower"][n], 1.0])
            for n, abc in v["sets"].items()
        }

    def midpoints(found):
        ends = found[1] if method == "Centroid" else found
        return {name: 0.5 * sum(pair) for name, pair in ends.items()}

    return build(system, engine, sets, midpoints)


def build(system, engine, sets, values):
    for v in system["inputs"]:
        engine.add_input_variable(v["name"])
    for v in system["outputs"]:
        engine.add_output_variable(v["name"])
    made = {v["name"]: sets(v) for v in system["inputs"] + system["outputs"]}
    inputs, outputs = ([v["name"] for v in system[k]] for k in ("inputs", "outputs"))
    for antecedents, consequents in system["rules"]:
        engine.add_rule(
            [(name, made[name][c]) for name, c in zip(inputs, antecedents, strict=True)],
            [(name, made[name][c]) for name, c in zip(outputs, consequents, strict=True)],
        )

    def evaluate(*x):
        found = values(engine.evaluate(dict(zip(inputs, x, strict=True))))
        return [found[name] for name in outputs]

    return row_by_row(evaluate)


def row_by_row(evaluate):
    return lambda rows: np.array([evaluate(*row) for row in rows.tolist()])


PEERS = {
    "scikit-fuzzy": scikit_fuzzy,
    "simpful": simpful,
    "pyfuzzylite": pyfuzzylite,
    "pyfuzzylite batch": pyfuzzylite_batch,
    "pyit2fls": pyit2fls_t1,
    "pyit2fls centroid": lambda system: pyit2fls_t2(system, "Centroid"),
    "pyit2fls centre of sets": lambda system: pyit2fls_t2(system, "CoSet"),
}


made = {}


def answer(request):
    name, rows = request["peer"], np.array(request["rows"])
    if name not in made:
        made[name] = PEERS[name](request["system"])
        made[name](rows[:1])
    began = perf_counter()
    found = made[name](rows)
    seconds = (perf_counter() - began) / len(rows)
    return {"seconds": seconds, "outputs": found.tolist()}


if __name__ == "__main__":
    serve(answer)
