"""Warnings of runs are seen: at the line of the caller, once per call, code and surfaces; nothing is lost."""

import inspect
import pickle
import subprocess
import sys
import warnings

import filippov as fl
import numpy as np
import pytest
from untraced import number

SHOWN = "non_unique"


def repel(t, x):
    return [np.sign(x[0])]


def rest_on_a_jump(t, x):
    """The jump vanishes at the start, where x[1] is zero, and nothing leaves its surface."""
    return [x[0], x[1] * np.sign(x[0])]


def here():
    return inspect.currentframe().f_back.f_lineno


def caught(call):
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        result = call()
    return result, found


REPELLING = fl.System(repel, n=1, states=("z",))
CALLS = [
    lambda: (here(), fl.solve_ivp(repel, (0, 1), [0.0])),
    lambda: (here(), REPELLING.solve((0, 1), [0.0])),
    lambda: (here(), REPELLING.solve((0, 1), [0.0], max_step=0.5)),
    lambda: (here(), REPELLING.solve((0, 1), [0.0], events=lambda t, x: x[0] - 0.5)),
    lambda: (here(), REPELLING.ensemble((0, 1), [[0.0], [1.0], [0.0]])),
    lambda: (here(), fl.sweep(REPELLING, (0, 1), {"z": [0.0, 1.0, 0.0]})),
    lambda: (here(), fl.basins(REPELLING, None, (0, 1), {"z": [0.0, 1.0, 0.0]})),
    lambda: (here(), fl.poincare(REPELLING, lambda t, x: x[0] - 0.5, (0, 1), [0.0])),
]


@pytest.mark.parametrize("call", CALLS)
@pytest.mark.parametrize("repeat", [1, 3])
def test_a_warning_points_to_the_line_of_the_caller(call, repeat):
    pytest.importorskip("xarray")
    for _ in range(repeat):  # the later calls of System.solve take a shorter way
        (line, result), found = caught(call)
        assert [warning.category for warning in found] == [fl.FilippovWarning]
        assert (found[0].filename, found[0].lineno) == (__file__, line)
        shown = found[0].message
        assert shown.code == SHOWN
        assert str(shown).startswith("non_unique: ")
        assert shown.result is result


# What a call leaves behind for the next one.
STATE = {"side": 0}


def repel_with_a_memory(t, x, a=1.0):
    """At x = 0 the solution is not unique, and an earlier call leaves something behind."""
    if x[0] > 0:
        STATE["side"] = 1
    else:
        STATE["side"] = -1
    return [a * np.sign(x[0])]


WARNING_TWICE = fl.System(repel_with_a_memory, n=1, states=("z",), params={"a": 1.0})
HALF = fl.Section(lambda t, x: x[0] - 0.5)
RUNS = {
    "solve_ivp": lambda: fl.solve_ivp(repel_with_a_memory, (0, 1), [0.0]),
    "solve": lambda: WARNING_TWICE.solve((0, 1), [0.0]),
    "branches": lambda: WARNING_TWICE.solve((0, 1), [0.0], nonunique="branch"),
    "ensemble": lambda: WARNING_TWICE.ensemble((0, 1), [[0.0], [1.0]]),
    "sweep": lambda: fl.sweep(WARNING_TWICE, (0, 1), {"z": [0.0, 1.0]}),
    "gradient": lambda: fl.gradient(WARNING_TWICE, (0, 1), [0.0], terminal=lambda t, y: y[0]),
    "lyapunov": lambda: fl.lyapunov(WARNING_TWICE, (0, 1), [0.0]),
    "basins": lambda: fl.basins(WARNING_TWICE, None, (0, 1), {"z": [0.0, 1.0]}),
    "poincare": lambda: fl.poincare(WARNING_TWICE, HALF, (0, 1), [0.0]),
    "bifurcation_diagram": lambda: fl.bifurcation_diagram(WARNING_TWICE, HALF, (0, 1), [0.0], {"a": [1, 2]}),
}


@pytest.mark.parametrize("name", RUNS)
def test_no_function_that_runs_a_system_swallows_a_warning(name):
    pytest.importorskip("xarray")
    for _ in range(2):
        result, found = caught(RUNS[name])
        codes = {code for warning in found for code in warning.message.code.split(", ")}
        assert codes == ({"memory"} if name == "branches" else {"non_unique", "memory"})
    if name in ("sweep", "basins", "bifurcation_diagram"):
        bit = result.warnings.attrs["flag_meanings"].split().index("memory")
        assert result.n_warnings.values.tolist() == [2, 2 if name == "bifurcation_diagram" else 1]
        assert (result.warnings.values >> bit & 1).tolist() == [1, 1]
    elif name == "ensemble":
        assert result.n_warnings.tolist() == [2, 1]
        codes_of = [[warning.code for warning in member.warnings] for member in result]
        assert codes_of == [["non_unique", "memory"], ["memory"]]
    elif name == "poincare":
        assert (result.attrs["n_warnings"], result.attrs["warnings"]) == (2, "non_unique memory")


def test_every_public_function_that_runs_a_system_is_looked_at():
    """A function that runs a system takes `t_span`; those that read a store or inspect points do not.

    `explore` shows a page; what runs there is `solve`.
    """
    public = {name: getattr(fl, name) for name in fl.__all__}
    methods = {name: value for name, value in vars(fl.System).items() if not name.startswith("_")}
    running = {
        name
        for name, value in {**public, **methods}.items()
        if inspect.isfunction(value) and "t_span" in inspect.signature(value).parameters
    }
    assert running == set(RUNS) - {"branches"} | {"explore"}


def test_the_warnings_of_all_branches_are_shown():
    def fun(t, x):
        # Below zero the field is stiff.
        return [np.sign(x[0]), np.where(x[0] < 0, -1e5 * (x[1] - np.cos(t)), 0.0)]

    sol, found = caught(lambda: fl.solve_ivp(fun, (0, 3), [0.0, 1.0], nonunique="branch", method="DOPRI5"))
    assert [{warning.code for warning in branch.warnings} - {"non_unique"} for branch in sol.branches] == [
        set(),
        {"stiff"},
    ]
    assert [warning.message.code for warning in found] == ["stiff"]


def test_a_copy_of_a_system_remembers_that_it_has_a_memory():
    copy = pickle.loads(pickle.dumps(WARNING_TWICE))
    _, found = caught(lambda: copy.solve((0, 1), [1.0]))
    assert [warning.message.code for warning in found] == ["memory"]


def test_a_bifurcation_diagram_shows_one_warning_at_the_line_of_the_caller():
    pytest.importorskip("xarray")
    system = fl.System(lambda t, x, a: [a * np.sign(x[0])], n=1, params={"a": 1.0})
    section = fl.Section(lambda t, x: x[0] - 0.5)
    (line, result), found = caught(
        lambda: (here(), fl.bifurcation_diagram(system, section, (0, 4), [0.0], {"a": [1.0, 2.0]}))
    )
    assert [(warning.filename, warning.lineno) for warning in found] == [(__file__, line)]
    assert result.n_warnings.values.tolist() == [1, 1]


def test_what_is_shown_says_what_was_found():
    sol, (found,) = caught(lambda: fl.solve_ivp(repel, (0, 1), [0.0]))
    (kept,) = sol.warnings
    assert str(found.message) == f"non_unique: {kept.message}"
    assert (found.message.t, found.message.surfaces) == (0.0, ("x[0]",))
    assert kept.surfaces == ("x[0]",)


def test_of_each_code_and_surface_the_first_is_shown():
    # Both states are at a repelling point at t = 0, and x[0] is set back to it twice.
    back = fl.Reset(times=[1.0, 2.0], map=lambda t, x: [0.0, x[1]])
    sol, found = caught(
        lambda: fl.solve_ivp(
            lambda t, x: [np.sign(x[0]), np.sign(x[1] - 1.0)], (0, 3), [0.0, 2.0], resets=back
        )
    )
    assert [warning.code for warning in sol.warnings] == [SHOWN] * 3
    assert len(found) == 1
    both, found = caught(
        lambda: fl.solve_ivp(
            lambda t, x: [np.sign(x[0]), np.sign(x[1] - 1.0)],
            (0, 3),
            [0.0, 2.0],
            resets=[back, fl.Reset(times=[1.5, 2.5], map=lambda t, x: [x[0], 1.0])],
        )
    )
    assert len(both.warnings) == 5
    assert {warning.message.surfaces for warning in found} == {("x[0]",), ("x[1] - 1",)}
    assert len(found) == 2


def test_a_run_without_warnings_shows_none():
    for call in (
        lambda: fl.solve_ivp(repel, (0, 1), [1.0]),
        lambda: REPELLING.solve((0, 1), [1.0]),
        lambda: REPELLING.ensemble((0, 1), [[1.0], [2.0]]),
    ):
        _, found = caught(call)
        assert found == []


def test_all_solutions_are_no_surprise_to_the_one_who_asks_for_them():
    sol, found = caught(lambda: fl.solve_ivp(repel, (0, 1), [0.0], nonunique="branch"))
    assert len(sol.branches) == 2
    assert found == []
    one = fl.SlidingPolicy(max_branches=1)
    _, found = caught(lambda: fl.solve_ivp(repel, (0, 1), [0.0], nonunique="branch", sliding=one))
    assert [warning.message.code for warning in found] == ["max_branches"]


def test_how_a_run_was_made_is_not_shown():
    sol, found = caught(
        lambda: fl.solve_ivp(lambda t, x: [-number(x[0])], (0, 3), [1.0], method="Taylor", surfaces=[])
    )
    assert [warning.code for warning in sol.warnings] == ["no_series"]
    assert found == []


@pytest.mark.parametrize(
    ("code", "call"),
    [
        (
            "undeclared_jump",
            lambda: fl.solve_ivp(
                lambda t, x: [number(x[0]) * 0.0 + (1.0 if number(x[0]) < 0.5 else 3.0)],
                (0, 1),
                [0.0],
                surfaces=[],
                method="DOPRI5",
            ),
        ),
        ("zero_surface", lambda: fl.solve_ivp(rest_on_a_jump, (0, 1), [0.0, 0.0])),
        (
            "stiff",
            lambda: fl.solve_ivp(lambda t, x: [-1e5 * (x[0] - np.cos(t))], (0, 3), [0.0], method="DOPRI5"),
        ),
    ],
)
def test_codes_that_are_shown(code, call):
    sol, found = caught(call)
    assert code in {warning.code for warning in sol.warnings}
    assert {warning.message.code for warning in found} == {warning.code for warning in sol.warnings}


@pytest.mark.parametrize("call", CALLS)
def test_nothing_is_lost_where_warnings_are_errors(call):
    pytest.importorskip("xarray")
    with pytest.raises(fl.FilippovWarning) as caught_error:
        call()
    (_, expected), _ = caught(call)
    result = caught_error.value.result
    assert type(result) is type(expected)
    if hasattr(expected, "data_vars"):
        assert result.identical(expected)
    else:
        assert np.array_equal(result.y, expected.y)


def test_a_code_is_silenced_by_the_start_of_the_text():
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        warnings.filterwarnings("ignore", "non_unique", fl.FilippovWarning)
        fl.solve_ivp(repel, (0, 1), [0.0])
        fl.solve_ivp(rest_on_a_jump, (0, 1), [0.0, 0.0])
    assert [warning.message.code for warning in found] == ["zero_surface"]


def test_many_runs_show_one_warning_and_count_their_own():
    pytest.importorskip("xarray")
    starts = np.where(np.arange(100) % 10, 1.0, 0.0)
    ensemble, found = caught(lambda: REPELLING.ensemble((0, 1), starts[:, np.newaxis]))
    assert ensemble.n_warnings.tolist() == [int(start == 0.0) for start in starts]
    assert "10 of 100 members" in str(found[0].message)
    result, swept = caught(lambda: fl.sweep(REPELLING, (0, 1), {"z": starts}))
    assert result.n_warnings.values.tolist() == ensemble.n_warnings.tolist()
    assert "10 of 100 points" in str(swept[0].message)
    meanings = result.warnings.attrs["flag_meanings"].split()
    masks = result.warnings.attrs["flag_masks"]
    assert masks == [1 << k for k in range(len(meanings))]
    bit = masks[meanings.index(SHOWN)]
    assert (result.warnings.values & bit != 0).tolist() == (starts == 0.0).tolist()
    assert len(found) == len(swept) == 1


def test_a_store_keeps_the_warnings_of_its_points(tmp_path):
    pytest.importorskip("zarr")
    starts = {"z": [0.0, 1.0, 0.0, 2.0]}
    given = {"store": tmp_path / "sweep", "chunk_size": 2}
    first, found = caught(lambda: fl.sweep(REPELLING, (0, 1), starts, **given))
    again, once_more = caught(lambda: fl.sweep(REPELLING, (0, 1), starts, **given))
    assert first.n_warnings.values.tolist() == again.n_warnings.values.tolist() == [1, 0, 1, 0]
    assert [str(w.message) for w in found] == [str(w.message) for w in once_more]
    assert len(found) == 1


def test_the_attributes_of_poincare_name_the_warnings():
    pytest.importorskip("xarray")
    found, _ = caught(lambda: fl.poincare(REPELLING, lambda t, x: x[0] - 0.5, (0, 1), [0.0]))
    assert (found.attrs["n_warnings"], found.attrs["warnings"]) == (1, SHOWN)


def test_a_warning_travels():
    with pytest.raises(fl.FilippovWarning) as found:
        REPELLING.solve((0, 1), [0.0])
    copy = pickle.loads(pickle.dumps(found.value))
    assert (copy.code, copy.t, copy.surfaces, str(copy)) == (SHOWN, 0.0, ("z",), str(found.value))
    assert np.array_equal(copy.result.y, found.value.result.y)


def test_a_script_shows_the_line_that_called(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "import numpy as np, filippov as fl\n"
        "for k in range(3):\n"
        "    sol = fl.solve_ivp(lambda t, x: [np.sign(x[0])], (0, 1 + k), [0.0])\n"
    )
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=True)
    assert done.stderr.count("FilippovWarning") == 1
    assert f"{script}:3: FilippovWarning: non_unique" in done.stderr
